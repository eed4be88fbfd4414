"""More of what draws already spread by."""

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["widened"]

Array = NDArray[np.float64]


def widened(z: Array, log_r: Array, factor: float) -> tuple[Array, Array]:
    """Return errors that multiply the variance of draws by a factor above 1 (Birge 1932).

    Parameters
    ----------
    z, log_r : ndarray, shape (n, d) and (n, frames)
        Draws; nan for a frame without object.
    factor : float
        The factor.

    Returns
    -------
    (ndarray, ndarray)
        Shapes (d, k) and (frames, k), k independent errors along the ways in which draws spread.
    """
    d = z.shape[1]
    draws = np.concatenate([z, np.where(np.isfinite(log_r), log_r, 0.0)], axis=1)
    _, sizes, ways = np.linalg.svd(draws - draws.mean(axis=0), full_matrices=False)
    more = (math.sqrt((factor - 1.0) / len(z)) * sizes[:, None] * ways).T
    return more[:d], more[d:]
