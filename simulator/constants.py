"""Constants of nature, exact by definition: the package that has them all is slow to import."""

__all__ = ["SPEED_OF_LIGHT"]

SPEED_OF_LIGHT = 299_792_458.0
"""[m/s]."""
