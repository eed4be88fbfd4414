"""Monotone intervals of a curve as arrays that kernels can read."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["MonotoneIntervals"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class MonotoneIntervals(NamedTuple):
    """Intervals in each of which a curve is monotone, ascending.

    Attributes
    ----------
    low, high : ndarray, shape (k,)
        Ends of the intervals.
    at_low, at_high : ndarray, shape (k,)
        The curve's values there; infinite at a pole, unwrapped for an angle.
    turns_low, turns_high : ndarray of bool, shape (k,)
        Whether the curve turns there.
    """

    low: Array
    high: Array
    at_low: Array
    at_high: Array
    turns_low: Flags
    turns_high: Flags
