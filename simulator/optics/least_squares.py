"""Linear least squares of a few columns of very different size."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

__all__ = ["Solution", "solve_scaled"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Solution:
    """Solution of a linear least squares problem of n rows and d columns.

    Attributes
    ----------
    x : ndarray, shape (d,)
        Where the rank is d; else zeros.
    covariance : ndarray, shape (d, d)
        Of x, from the residuals; nan where the rank is below d, or nothing is left over for them.
    residuals : ndarray, shape (n,)
        At x.
    rank : int
        To within rounding.
    """

    x: Array
    covariance: Array
    residuals: Array
    rank: int


def _inverse(r: Array) -> Array:
    """Return the inverse of an upper triangle of two or three columns by back-substitution."""
    n = r.shape[0]
    inverse = np.zeros((n, n))
    for j in range(n):
        inverse[j, j] = 1.0 / r[j, j]
        for i in range(j - 1, -1, -1):
            inverse[i, j] = -float(r[i, i + 1 : j + 1] @ inverse[i + 1 : j + 1, j]) / r[i, i]
    return inverse


def solve_scaled(matrix: Array, target: Array) -> Solution:
    """Solve least squares by QR with columns scaled to unit length and pivoting for the rank.

    Parameters
    ----------
    matrix : ndarray, shape (n, d)
        No column is zero.
    target : ndarray, shape (n,)
        What its product with x should be.
    """
    scale = np.linalg.norm(matrix, axis=0)
    q, r, order = linalg.qr(matrix / scale, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(r))
    rank = int(np.sum(diagonal > diagonal[0] * max(matrix.shape) * np.finfo(np.float64).eps))
    columns = matrix.shape[1]
    solution = np.zeros(columns)
    inverse = np.full((columns, columns), np.nan)
    if rank == columns:
        inverse_r = _inverse(r)
        solution[order] = inverse_r @ (q.T @ target)
        inverse[np.ix_(order, order)] = inverse_r @ inverse_r.T
    residuals = matrix @ (solution / scale) - target
    freedom = matrix.shape[0] - columns
    variance = float(residuals @ residuals) / freedom if freedom > 0 else math.nan
    return Solution(
        x=solution / scale,
        covariance=variance * inverse / np.outer(scale, scale),
        residuals=residuals,
        rank=rank,
    )
