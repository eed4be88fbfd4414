"""Kalman steps on roots of covariances: predict, update, merge; nothing is ever subtracted.

A hypothesis holds the mean x of (u, du/dt) and, where crosstalk drifts, of two crosstalk readings;
n is 2 or 4 (x then has a fifth column, `inference.tracking.shared_error`). Its error is X w with w
standard normal: the first n columns of X are its own, lower triangular; the last p belong to the
globals, which all frames share. Globals are "considered" as in
the Schmidt-Kalman filter: no frame makes them better known, so that what they do to the range never
averages down; the state learns from a frame as much as it can beside them.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import Triple, add_factor
from simulator.compiled import compiled

__all__ = ["drop_lightest", "merge", "merge_equals", "move", "solve", "triangularise", "update"]

Array = NDArray[np.float64]


@compiled
def triangularise(work: Array, first: int, rows: int, columns: int) -> None:
    """Rotate columns ``first`` to ``columns`` until rows ``first`` to ``rows`` are triangular."""
    for i in range(first, rows):
        for j in range(i + 1, columns):
            b = work[i, j]
            if b == 0.0:
                continue
            a = work[i, i]
            length = math.sqrt(a * a + b * b)
            if length == 0.0:  # squares underflow
                work[i, j] = 0.0
                continue
            cosine, sine = a / length, b / length
            work[i, i], work[i, j] = length, 0.0
            for k in range(i + 1, rows):
                left, right = work[k, i], work[k, j]
                work[k, i] = cosine * left + sine * right
                work[k, j] = cosine * right - sine * left


@compiled
def move(
    x: Array,
    X: Array,
    row: int,
    carry: float,
    decay: float,
    noise: Triple,
    drift1: float,
    drift2: float,
    work: Array,
) -> None:
    """Let time pass for one hypothesis.

    Parameters
    ----------
    x, X : ndarray, shape (rows, n), (rows, n, n + p)
        Means and roots; changed in place.
    row : int
        The hypothesis.
    carry, decay : float
        u grows by carry du/dt, and du/dt shrinks by the factor decay.
    noise : (float, float, float)
        Triangular root of the noise of (u, du/dt) that enters.
    drift1, drift2 : float
        Standard deviations by which the crosstalk drifts.
    work : ndarray, shape (n, at least 2 n)
        Overwritten.
    """
    n = X.shape[1]
    x[row, 0] += carry * x[row, 1]
    x[row, 1] *= decay
    for j in range(X.shape[2]):
        X[row, 0, j] += carry * X[row, 1, j]
        X[row, 1, j] *= decay
    for i in range(n):
        for j in range(n):
            work[i, j] = X[row, i, j]
            work[i, n + j] = 0.0
    work[0, n], work[1, n], work[1, n + 1] = noise
    if n > 2:
        work[2, n + 2], work[3, n + 3] = drift1, drift2
    triangularise(work, 0, n, 2 * n)
    for i in range(n):
        for j in range(n):
            X[row, i, j] = work[i, j]


@compiled
def solve(root: Triple, first: float, second: float) -> tuple[float, float]:
    """Return (root root^T)^-1 times a vector."""
    z1 = first / root[0]
    z2 = (second - root[1] * z1) / root[2]
    y2 = z2 / root[2]
    return (z1 - root[1] * y2) / root[0], y2


@compiled
def update(
    x: Array,
    X: Array,
    row: int,
    residual1: float,
    residual2: float,
    slopes: tuple[float, float, float, float],
    noise: Triple,
    columns: Array,
    work: Array,
    factors: Array,
) -> float:
    """Learn from two readings that are linear in the hypothesis.

    Parameters
    ----------
    x, X : ndarray
        As in `move`; changed in place.
    row : int
        The hypothesis.
    residual1, residual2 : float
        Readings less their prediction.
    slopes : (float, float, float, float)
        Derivatives of the two readings along u, then along du/dt.
    noise : (float, float, float)
        Triangular root of the noise's covariance.
    columns : ndarray, shape (2, p)
        Change of the readings with the globals.
    work, factors : ndarray, shape (n, at least n + 2), (4, n + p)
        Overwritten.

    Returns
    -------
    float
        Normalised innovation squared.
    """
    n, m = X.shape[1], X.shape[2]
    root = noise
    for j in range(m):
        f1 = slopes[0] * X[row, 0, j] + slopes[2] * X[row, 1, j]
        f2 = slopes[1] * X[row, 0, j] + slopes[3] * X[row, 1, j]
        if n > 2:
            f1, f2 = f1 + X[row, 2, j], f2 + X[row, 3, j]
        if j >= n:
            f1, f2 = f1 + columns[0, j - n], f2 + columns[1, j - n]
        factors[0, j], factors[1, j] = f1, f2
        root = add_factor(root, f1, f2)
    pull1, pull2 = solve(root, residual1, residual2)
    for j in range(m):
        factors[2, j], factors[3, j] = solve(root, factors[0, j], factors[1, j])
    for i in range(n):
        gain1, gain2 = 0.0, 0.0
        for j in range(m):
            gain1 += X[row, i, j] * factors[2, j]
            gain2 += X[row, i, j] * factors[3, j]
        work[i, n] = gain1 * noise[0] + gain2 * noise[1]
        work[i, n + 1] = gain2 * noise[2]
        x[row, i] += gain1 * residual1 + gain2 * residual2
        for j in range(m):
            value = X[row, i, j] - gain1 * factors[0, j] - gain2 * factors[1, j]
            if j < n:
                work[i, j] = value
            else:
                X[row, i, j] = value
    triangularise(work, 0, n, n + 2)
    for i in range(n):
        for j in range(n):
            X[row, i, j] = work[i, j]
    return residual1 * pull1 + residual2 * pull2


@compiled
def merge(
    x: Array,
    X: Array,
    into: int,
    other: int,
    share: float,
    first: int,
    work: Array,
) -> None:
    """Replace one hypothesis by the mean and covariance of two.

    Parameters
    ----------
    x, X : ndarray
        As in `move`; changed in place.
    into, other : int
        The hypotheses; ``into`` is overwritten.
    share : float
        Weight of ``other`` in the mixture of the two.
    first : int
        Only the states from this one on are merged.
    work : ndarray, shape (n, at least 3 n + p + 1)
        Overwritten.
    """
    n, m = X.shape[1], X.shape[2]
    left, right = math.sqrt(1.0 - share), math.sqrt(share)
    for i in range(first, n):
        gap = x[other, i] - x[into, i]
        x[into, i] += share * gap
        # a place of its own for every column: triangularise reads from column ``first`` on
        for j in range(n):
            work[i, j] = 0.0
            work[i, n + j] = left * X[into, i, j]
            work[i, 2 * n + j] = right * X[other, i, j]
        work[i, 3 * n] = left * right * gap
        for j in range(n, m):
            change = X[other, i, j] - X[into, i, j]
            work[i, 2 * n + 1 + j] = left * right * change
            X[into, i, j] += share * change
    triangularise(work, first, n, 2 * n + 1 + m)
    for i in range(first, n):
        for j in range(n):
            X[into, i, j] = work[i, j] if j >= first else 0.0


@compiled
def _log_determinant(x: Array, X: Array, one: int, other: int, share: float) -> float:
    """Return the log determinant of the covariance of (u, du/dt) of a mixture of two hypotheses."""
    p11, p12, p22 = 0.0, 0.0, 0.0
    for row, weight in ((one, 1.0 - share), (other, share)):
        if weight == 0.0:
            continue
        for j in range(X.shape[2]):
            p11 += weight * X[row, 0, j] * X[row, 0, j]
            p12 += weight * X[row, 0, j] * X[row, 1, j]
            p22 += weight * X[row, 1, j] * X[row, 1, j]
    spread = share * (1.0 - share)
    gap1, gap2 = x[other, 0] - x[one, 0], x[other, 1] - x[one, 1]
    p11 += spread * gap1 * gap1
    p12 += spread * gap1 * gap2
    p22 += spread * gap2 * gap2
    if p22 == 0.0:  # an object at rest has no rate to be told apart by
        return math.log(p11) if p11 > 0.0 else -math.inf
    rest = max(p22 - p12 * (p12 / p11), 1e-14 * p22) if p11 > 0.0 else 0.0
    return math.log(p11 * rest) if p11 * rest > 0.0 else -math.inf


@compiled
def _replace(x: Array, X: Array, weight: Array, row: int, other: int) -> None:
    """Put one hypothesis in the place of another."""
    weight[row] = weight[other]
    for i in range(x.shape[1]):
        x[row, i] = x[other, i]
    for i in range(X.shape[1]):
        for c in range(X.shape[2]):
            X[row, i, c] = X[other, i, c]


@compiled
def drop_lightest(x: Array, X: Array, weight: Array, count: int) -> int:
    """Drop the lightest of the hypotheses in rows 1 to count; how many are left."""
    lightest = 1
    for j in range(2, count + 1):
        if weight[j] < weight[lightest]:
            lightest = j
    _replace(x, X, weight, lightest, count)
    return count - 1


@compiled
def merge_equals(x: Array, X: Array, weight: Array, count: int, same: float, work: Array) -> int:
    """Merge hypotheses that say the same.

    The information that a merger loses has a bound (Runnalls 2007); here it is held against the
    weight of the lighter one, so that a light root far from a heavy one stays.

    Parameters
    ----------
    x, X, weight : ndarray
        Hypotheses in rows 1 to count; changed in place.
    count : int
        Their number.
    same : float
        Bound [nats per weight of the lighter one].
    work : ndarray
        As for `merge`.

    Returns
    -------
    int
        How many are left.
    """
    j = 1
    while j <= count:
        k = j + 1
        while k <= count:
            heavy, light = (j, k) if weight[j] >= weight[k] else (k, j)
            share = weight[light] / (weight[j] + weight[k])
            both = _log_determinant(x, X, heavy, light, share)
            one = _log_determinant(x, X, heavy, light, 0.0)
            other = _log_determinant(x, X, light, heavy, 0.0)
            lost = 0.5 * (both - (1.0 - share) * one - share * other)
            if not lost < same * share:
                k += 1
                continue
            # the mixture is symmetric in the two: merged into j, whichever is heavier
            merge(x, X, j, k, weight[k] / (weight[j] + weight[k]), 0, work)
            weight[j] += weight[k]
            _replace(x, X, weight, k, count)
            count -= 1
            k = j + 1  # the merged one may equal others now
        j += 1
    return count
