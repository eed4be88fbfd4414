"""Least squares by Householder triangles, never by normal equations."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from simulator.compiled import compiled

__all__ = ["damped_step", "reduce_columns", "solve_least_squares", "triangle_of"]

Array = NDArray[np.float64]

_BLOCK = 32  # columns that LAPACK reduces at a time
_MANY, _SELDOM = 500, 0.25  # rows from which that is worth a look, and the share of a few


def triangle_of(rows: Array) -> Array:
    """Return the triangle of a QR decomposition, shape (min(m, n), n).

    Where columns are zero but in a few rows, such as errors that a few of many frames share, the
    other rows are reduced first, without them.

    Parameters
    ----------
    rows : ndarray, shape (m, n)
        At least one.
    """
    if len(rows) > _MANY:
        present = rows != 0.0
        often = present.sum(axis=0) >= _SELDOM * len(rows)
        apart = ~present[:, ~often].any(axis=1)
        if apart.any() and often.any():
            first = _reduced(rows[np.ix_(apart, often)])
            whole = np.zeros((len(first), rows.shape[1]))
            whole[:, often] = first
            rows = np.concatenate([whole, rows[~apart]])
    return _reduced(rows)


def _reduced(rows: Array) -> Array:
    # numpy's also clears and copies what is not asked for
    reduced = lapack.dgeqrf(rows, lwork=_BLOCK * rows.shape[1])[0]
    return np.asarray(np.triu(reduced[: rows.shape[1]]))


@compiled
def reduce_columns(matrix: Array, columns: int) -> None:
    """Reduce the leading columns of a matrix to an upper triangle, in place.

    Parameters
    ----------
    matrix : ndarray, shape (m, n)
        Columns beyond ``columns`` (right-hand sides) are carried along. What lies below the
        triangle is not cleared.
    columns : int
        How many are reduced.
    """
    rows, width = matrix.shape
    for k in range(min(columns, rows)):
        # scaled, so that squares of large rows do not overflow
        largest = 0.0
        for i in range(k, rows):
            largest = max(largest, abs(matrix[i, k]))
        if largest == 0.0 or not math.isfinite(largest):
            continue
        square = 0.0
        for i in range(k, rows):
            part = matrix[i, k] / largest
            square += part * part
        norm = -math.copysign(largest * math.sqrt(square), matrix[k, k])
        head = matrix[k, k] - norm
        for j in range(k + 1, width):
            along = head * matrix[k, j]
            for i in range(k + 1, rows):
                along += matrix[i, k] * matrix[i, j]
            # (head^2 + rest) / 2 = -norm head
            along /= -norm * head
            matrix[k, j] -= along * head
            for i in range(k + 1, rows):
                matrix[i, j] -= along * matrix[i, k]
        matrix[k, k] = norm


@compiled
def _back_substitute(solution: Array, triangle: Array, n: int) -> None:
    """Solve triangle[:n, :n] x = triangle[:n, n]; 0 where the diagonal vanishes."""
    for i in range(n - 1, -1, -1):
        total = triangle[i, n]
        for j in range(i + 1, n):
            total -= triangle[i, j] * solution[j]
        solution[i] = total / triangle[i, i] if triangle[i, i] != 0.0 else 0.0


@compiled
def solve_least_squares(solution: Array, matrix: Array) -> None:
    """Solve least squares; the last column of ``matrix`` is the right-hand side, overwritten.

    Parameters
    ----------
    solution : ndarray, shape (n,)
        Filled.
    matrix : ndarray, shape (m, n + 1)
        m >= n.
    """
    n = solution.size
    scale = np.ones(n)
    for j in range(n):
        largest = 0.0
        for i in range(matrix.shape[0]):
            largest = max(largest, abs(matrix[i, j]))
        if largest > 0.0:
            scale[j] = largest
            for i in range(matrix.shape[0]):
                matrix[i, j] /= largest
    reduce_columns(matrix, n)
    _back_substitute(solution, matrix, n)
    for j in range(n):
        solution[j] /= scale[j]


@compiled
def damped_step(step: Array, triangle: Array, scale: Array, damping: float) -> None:
    """Solve the damped system min |R s - q|^2 + damping |scale s|^2.

    Parameters
    ----------
    step : ndarray, shape (d,)
        Filled with s.
    triangle : ndarray, shape (at least d, d + 1)
        R with q as its last column.
    scale : ndarray, shape (d,)
        Column norms; 0 keeps a coordinate where it is.
    damping : float
        Not negative.
    """
    d = step.size
    work = np.zeros((2 * d, d + 1))
    root = math.sqrt(damping)
    for i in range(d):
        for j in range(i, d):
            if scale[j] > 0.0:
                work[i, j] = triangle[i, j] / scale[j]
        work[i, d] = triangle[i, d]
        work[d + i, i] = root if scale[i] > 0.0 else 1.0
    reduce_columns(work, d)
    _back_substitute(step, work, d)
    for j in range(d):
        step[j] = step[j] / scale[j] if scale[j] > 0.0 else 0.0
