"""Systems of two equations, one for each frame.

numpy calls a library for each of them, and the calls cost more than what is computed. As of these
nothing is said of numbers that are not finite, which come out again.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["cholesky", "solved", "solved_by_root"]

Array = NDArray[np.float64]


@np.errstate(all="ignore")
def cholesky(matrices: Array) -> Array:
    """Return lower triangular roots of symmetric positive definite matrices, shape (n, 2, 2)."""
    root = np.zeros_like(matrices)
    root[:, 0, 0] = np.sqrt(matrices[:, 0, 0])
    root[:, 1, 0] = matrices[:, 1, 0] / root[:, 0, 0]
    root[:, 1, 1] = np.sqrt(matrices[:, 1, 1] - np.square(root[:, 1, 0]))
    return root


@np.errstate(all="ignore")
def solved_by_root(roots: Array, parts: Array) -> Array:
    """Solve with lower triangular matrices.

    Parameters
    ----------
    roots : ndarray, shape (n, 2, 2)
        The matrices.
    parts : ndarray, shape (n, 2, m)
        Right-hand sides.

    Returns
    -------
    ndarray, shape (n, 2, m)
        Solutions.
    """
    found = np.empty_like(parts)
    found[:, 0] = parts[:, 0] / roots[:, 0, 0, None]
    found[:, 1] = (parts[:, 1] - roots[:, 1, 0, None] * found[:, 0]) / roots[:, 1, 1, None]
    return found


@np.errstate(all="ignore")
def solved(matrices: Array, parts: Array) -> Array:
    """Solve by elimination with row pivoting; shapes as of `solved_by_root`."""
    turned = np.abs(matrices[:, 1, 0]) > np.abs(matrices[:, 0, 0])
    first, second = (np.where(turned[:, None], matrices[:, 1 - i], matrices[:, i]) for i in (0, 1))
    one, other = (np.where(turned[:, None], parts[:, 1 - i], parts[:, i]) for i in (0, 1))
    factor = second[:, 0] / first[:, 0]
    found = np.empty_like(parts)
    left = second[:, 1] - factor * first[:, 1]
    found[:, 1] = (other - factor[:, None] * one) / left[:, None]
    found[:, 0] = (one - first[:, 1, None] * found[:, 1]) / first[:, 0, None]
    return found
