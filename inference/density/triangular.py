"""Triangular factors of a precision matrix, and what is solved by them."""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["cholesky", "solve_factor", "update_factor"]

Array = NDArray[np.float64]


@compiled
def _dot(a: Array, b: Array, count: int) -> float:
    """Return the inner product of the first members, in four sums that do not wait for another."""
    first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
    even = count - count % 4
    for i in range(0, even, 4):
        first += a[i] * b[i]
        second += a[i + 1] * b[i + 1]
        third += a[i + 2] * b[i + 2]
        fourth += a[i + 3] * b[i + 3]
    for i in range(even, count):
        first += a[i] * b[i]
    return (first + second) + (third + fourth)


@compiled
def update_factor(factor: Array, rows: Array, count: int) -> None:
    """Update an upper triangular R to that of R^T R + rows rows^T by Householder reflections.

    Parameters
    ----------
    factor : ndarray, shape (k, k)
        R, overwritten.
    rows : ndarray, shape (k, at least count)
        One column a row of the least squares problem; overwritten.
    count : int
        Columns in use.
    """
    size = factor.shape[0]
    for k in range(size):
        square = _dot(rows[k], rows[k], count)
        if square == 0.0:
            continue
        norm = math.sqrt(factor[k, k] * factor[k, k] + square)
        head = factor[k, k] + math.copysign(norm, factor[k, k])
        beta = 2.0 / (head * head + square)
        for j in range(k + 1, size):
            dot = beta * (head * factor[k, j] + _dot(rows[k], rows[j], count))
            factor[k, j] -= dot * head
            for i in range(count):
                rows[j, i] -= dot * rows[k, i]
        factor[k, k] = -math.copysign(norm, factor[k, k])


@compiled
def solve_factor(factor: Array, vector: Array) -> float:
    """Overwrite v by (R^T R)^-1 v; return half of v^T (R^T R)^-1 v."""
    size = vector.size
    half = 0.0
    for k in range(size):
        total = vector[k]
        for j in range(k):
            total -= factor[j, k] * vector[j]
        vector[k] = total / factor[k, k]
        half += 0.5 * vector[k] * vector[k]
    for k in range(size - 1, -1, -1):
        total = vector[k]
        for j in range(k + 1, size):
            total -= factor[k, j] * vector[j]
        vector[k] = total / factor[k, k]
    return half


@compiled
def cholesky(matrix: Array) -> bool:
    """Overwrite the upper triangle by R with R^T R = matrix; False where rounding spoils it."""
    size = matrix.shape[0]
    for k in range(size):
        for i in range(k):
            for j in range(k, size):
                matrix[k, j] -= matrix[i, k] * matrix[i, j]
        if not matrix[k, k] > 0.0:
            return False
        root = math.sqrt(matrix[k, k])
        for j in range(k, size):
            matrix[k, j] /= root
    return True
