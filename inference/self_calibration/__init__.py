"""Streams that calibrate themselves: from priors to a known scene, and again as it changes."""
