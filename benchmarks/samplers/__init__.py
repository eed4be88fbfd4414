"""Samplers on one density in one run."""
