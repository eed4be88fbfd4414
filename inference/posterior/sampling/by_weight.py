"""Draws by their weights: which carry anything, and some of them as often as the weights say."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["heavy", "systematic"]

Array = NDArray[np.float64]

_HEAVY = 1e-3  # of the largest weight


def heavy(weights: Array) -> NDArray[np.bool_]:
    """Tell which draws carry more than next to nothing: the others are no modes."""
    return np.asarray(weights > _HEAVY * weights.max(initial=0.0))


def systematic(weights: Array, size: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return indices of so many draws by weight, each as often as that says to within one.

    Parameters
    ----------
    weights : ndarray, shape (n,)
        Of any sum above zero.
    size : int
        How many.
    rng : numpy.random.Generator
        Of which one number is asked.

    Returns
    -------
    ndarray of int, shape (size,)
        Ascending.
    """
    positions = (rng.random() + np.arange(size)) / size
    sums = np.cumsum(weights / weights.sum())
    return np.minimum(np.searchsorted(sums, positions), len(weights) - 1)
