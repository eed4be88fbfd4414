"""The collapsed likelihood: frames with their ranges integrated, or maximised, out of them."""
