"""What readings can tell of a scene: rank, Cramer-Rao bounds, and what would help."""
