"""Pages: their links, their code, and what their examples print."""
