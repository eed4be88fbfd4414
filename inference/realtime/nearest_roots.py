"""Which roots of a frame are those of another one that was solved a little off."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["nearest"]

Array = NDArray[np.float64]


def nearest(roots: Array, others: Array) -> Array:
    """Return for each root, shape (n, m), the nearest of others, shape (n, k); nan of none."""
    if others.shape[1] == 1:
        return np.broadcast_to(others, roots.shape)
    away = np.abs(roots[:, :, None] - others[:, None, :])
    away = np.where(np.isnan(away), np.inf, away)
    return np.take_along_axis(others, np.argmin(away, axis=2), axis=1)
