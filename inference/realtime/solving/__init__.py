"""Every root of a technique's equation: curves, their monotone intervals, brackets of roots."""
