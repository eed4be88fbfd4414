"""Weighted linear least squares by QR with scaled columns."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from simulator.scipy_later import scipy

__all__ = ["LinearFit", "solve_weighted"]

Array = NDArray[np.float64]

_ROUNDING = 1e-12


@dataclasses.dataclass(frozen=True, eq=False)
class LinearFit:
    """Result of linear least squares.

    Attributes
    ----------
    x : ndarray, shape (p,)
        Solution.
    factor : ndarray, shape (p, p)
        F with F F^T its covariance.
    rank : int
        Of the weighted matrix.
    residuals : ndarray, shape (m,)
        Weighted: of unit variance where the model holds.
    used : ndarray of bool, shape (n,)
        Frames that took part.
    ranges : ndarray, shape (n,)
        The root of each frame that the fit chose [m], nan where there is none.
    light : ndarray, shape (m,)
        How far the object's whole light moves each weighted row.
    """

    x: Array
    factor: Array
    rank: int
    residuals: Array
    used: NDArray[np.bool_]
    ranges: Array
    light: Array

    @property
    def chi_square(self) -> float:
        """Sum of squares of the weighted residuals."""
        return float(self.residuals @ self.residuals)


def solve_weighted(matrix: Array, target: Array) -> tuple[Array, Array, int]:
    """Solve least squares by QR with scaled columns.

    Parameters
    ----------
    matrix : ndarray, shape (m, p)
        Whitened.
    target : ndarray, shape (m,)
        Whitened.

    Returns
    -------
    (ndarray, ndarray, int)
        Solution, F with F F^T its covariance, rank; nan where the rank is not full.
    """
    p = matrix.shape[1]
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    q, r = scipy.linalg.qr(matrix / scale, mode="economic")
    sizes = scipy.linalg.svdvals(r)
    rank = int(np.count_nonzero(sizes > _ROUNDING * sizes[0])) if sizes.size else 0
    if rank < p:
        return np.full(p, np.nan), np.full((p, p), np.nan), rank
    inverse = scipy.linalg.solve_triangular(r, np.eye(p)) / scale[:, None]
    return inverse @ (q.T @ target), inverse, rank
