"""From draws to an answer that never averages over two modes."""
