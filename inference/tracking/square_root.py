"""Kalman steps on roots of covariances: predict and update; nothing is ever subtracted.

Nuisance parameters are "considered" as in the Schmidt-Kalman filter: no frame makes them better
known, so that what they do to the range never averages down; the state learns from a frame as much
as it can beside them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2, Hypotheses, Scratch, U, V
from inference.tracking.motion import Motion
from inference.tracking.readings_table import FIRST, SECOND
from inference.tracking.roots import Root, add_factor, add_factors, rotation, solve
from simulator.compiled import compiled

__all__ = ["Linear", "move", "triangularise", "update", "update_range"]

Array = NDArray[np.float64]


class Linear(NamedTuple):
    """Two readings that are linear in a hypothesis."""

    # readings less their prediction
    residual1: float
    residual2: float
    # their derivatives along u
    by_u1: float
    by_u2: float
    # along du/dt
    by_v1: float
    by_v2: float
    noise: Root  # of the noise's covariance


@compiled
def triangularise(work: Array, first: int, rows: int, columns: int) -> None:
    """Rotate columns ``first`` to ``columns`` until rows ``first`` to ``rows`` are triangular."""
    for i in range(first, rows):
        for j in range(i + 1, columns):
            b = work[i, j]
            if b == 0.0:
                continue
            length, cosine, sine = rotation(work[i, i], b)
            work[i, i], work[i, j] = length, 0.0
            for k in range(i + 1, rows):
                left, right = work[k, i], work[k, j]
                work[k, i] = cosine * left + sine * right
                work[k, j] = cosine * right - sine * left


@borrowed
@compiled
def move(of: Hypotheses, row: int, motion: Motion, work: Array) -> None:
    """Let time pass for one hypothesis.

    Parameters
    ----------
    of : Hypotheses
        Changed in place.
    row : int
        The hypothesis.
    motion : Motion
        How states move.
    work : ndarray, shape (n, at least 2 n)
        Overwritten.
    """
    x, X = of.x, of.X
    n = X.shape[1]
    x[row, U] += motion.carry * x[row, V]
    x[row, V] *= motion.decay
    for j in range(X.shape[-1]):
        X[row, U, j] += motion.carry * X[row, V, j]
        X[row, V, j] *= motion.decay
    for i in range(n):
        for j in range(n):
            work[i, j] = X[row, i, j]
            work[i, n + j] = 0.0
    noise = motion.noise
    work[U, n], work[V, n], work[V, n + 1] = noise.r11, noise.r21, noise.r22
    if n > 2:
        work[CROSSTALK1, n + 2], work[CROSSTALK2, n + 3] = motion.drift1, motion.drift2
    triangularise(work, 0, n, 2 * n)
    for i in range(n):
        for j in range(n):
            X[row, i, j] = work[i, j]


@borrowed
@compiled
def update(of: Hypotheses, row: int, readings: Linear, scratch: Scratch, taught: int) -> float:
    """Learn from two readings that are linear in the hypothesis.

    Parameters
    ----------
    of : Hypotheses
        Changed in place.
    row : int
        The hypothesis.
    readings : Linear
        The readings.
    scratch : Scratch
        ``nuisance`` holds the change of the readings with the nuisance parameters; the rest is
        overwritten.
    taught : int
        How many states, the first, learn; others are considered, as nuisance parameters are.

    Returns
    -------
    float
        Normalised innovation squared.
    """
    x, X = of.x, of.X
    work, factors, pulls = scratch.work, scratch.factors, scratch.pulls
    noise, residual1, residual2 = readings.noise, readings.residual1, readings.residual2
    _, n, m = X.shape
    root = noise
    for j in range(m):
        f1 = readings.by_u1 * X[row, U, j] + readings.by_v1 * X[row, V, j]
        f2 = readings.by_u2 * X[row, U, j] + readings.by_v2 * X[row, V, j]
        if n > 2:
            f1, f2 = f1 + X[row, CROSSTALK1, j], f2 + X[row, CROSSTALK2, j]
        if j >= n:
            f1 = f1 + scratch.nuisance[FIRST, j - n]
            f2 = f2 + scratch.nuisance[SECOND, j - n]
        factors[FIRST, j], factors[SECOND, j] = f1, f2
        if j < n:
            root = add_factor(root, f1, f2)
    root = add_factors(root, factors, n)
    pull1, pull2 = solve(root, residual1, residual2)
    for j in range(m):
        pulls[FIRST, j], pulls[SECOND, j] = solve(root, factors[FIRST, j], factors[SECOND, j])
    for i in range(n):
        gain1, gain2 = 0.0, 0.0
        for j in range(m):
            gain1 += X[row, i, j] * pulls[FIRST, j]
            gain2 += X[row, i, j] * pulls[SECOND, j]
        if i >= taught:
            gain1, gain2 = 0.0, 0.0
        work[i, n] = gain1 * noise.r11 + gain2 * noise.r21
        work[i, n + 1] = gain2 * noise.r22
        x[row, i] += gain1 * residual1 + gain2 * residual2
        for j in range(m):
            value = X[row, i, j] - gain1 * factors[FIRST, j] - gain2 * factors[SECOND, j]
            if j < n:
                work[i, j] = value
            else:
                X[row, i, j] = value
    triangularise(work, 0, n, n + 2)
    for i in range(n):
        for j in range(n):
            X[row, i, j] = work[i, j]
    return residual1 * pull1 + residual2 * pull2


@borrowed
@compiled
def update_range(
    of: Hypotheses, row: int, residual: float, slope: float, scratch: Scratch
) -> float:
    """Learn from a number that depends on log r alone.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; changed in place.
    residual : float
        The number less its prediction, in units of its standard deviation.
    slope : float
        Its derivative along log r, in the same units.
    scratch : Scratch
        Overwritten.

    Returns
    -------
    float
        Normalised innovation squared.
    """
    x, X, work, factors = of.x, of.X, scratch.work, scratch.factors
    _, n, m = X.shape
    variance = 1.0
    for j in range(m):
        factors[FIRST, j] = slope * X[row, U, j]
        variance += factors[FIRST, j] * factors[FIRST, j]
    for i in range(n):
        gain = 0.0
        for j in range(m):
            gain += X[row, i, j] * factors[FIRST, j]
        gain /= variance
        work[i, n] = gain
        x[row, i] += gain * residual
        for j in range(m):
            value = X[row, i, j] - gain * factors[FIRST, j]
            if j < n:
                work[i, j] = value
            else:
                X[row, i, j] = value
    triangularise(work, 0, n, n + 1)
    for i in range(n):
        for j in range(n):
            X[row, i, j] = work[i, j]
    return residual * residual / variance
