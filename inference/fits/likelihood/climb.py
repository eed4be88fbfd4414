"""Levenberg-Marquardt over everything unknown, with every range at its best value all the way."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.coordinates import Layout, bounds_of, chain, physical
from inference.fits.likelihood.deviance import deviance
from inference.fits.likelihood.linearisation import linearise
from inference.fits.likelihood.slopes import SLOTS
from inference.fits.likelihood.triangle import damped_step, triangularise
from simulator.compiled import compiled

__all__ = ["climb"]

Array = NDArray[np.float64]

_LONGEST = 1.5  # of a step in a logarithm: a factor of 4.5
_TRIES = 12
_ENOUGH = 1e-4  # deviance that a whole Newton step would still gain


@compiled
def climb(
    x: Array,
    best: Array,
    report: Array,
    layout: Layout,
    work: Any,
    nearest: float,
    gain: float,
    background: bool | None,
    frames: Array,
    present: NDArray[np.bool_],
    instrument: Any,
    iterations: int,
) -> None:
    """Climb to a maximum of the likelihood.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Start, moved to the end point.
    best : ndarray, shape (1, frames, 3)
        Filled with the best ranges there.
    report : ndarray, shape (4,)
        Filled: deviance, what a whole Newton step would gain, iterations used, damping.
        On entry report[3] is the damping to begin with.
    layout, work, nearest, gain, background, frames, present, instrument
        As for `deviance` and `coordinates.physical`; ``work`` holds its four arrays.
    iterations : int
        At most so many steps.
    """
    d = x.size
    n = frames.shape[0]
    m = 2 if instrument[3] is None else 5
    values, trial_values = np.ones(SLOTS + 1), np.ones(SLOTS + 1)
    low, high = np.empty(d), np.empty(d)
    trial, step, scale = np.empty(d), np.empty(d), np.empty(d)
    slopes = np.empty((SLOTS, d))
    matrix = np.empty((n * m, d + 1))
    triangle = np.zeros((d, d + 1))
    trial_best = np.empty_like(best)
    report[0], report[1], report[2] = math.inf, math.inf, 0.0
    damping = report[3]
    physical(values, x, layout)
    bounds_of(low, high, values, layout)
    for j in range(d):
        x[j] = min(max(x[j], low[j]), high[j])
    if not physical(values, x, layout):
        return
    value = deviance(
        best,
        values,
        work[0],
        work[1],
        work[2],
        work[3],
        nearest,
        gain,
        frames,
        present,
        instrument,
    )
    report[0] = value
    if not math.isfinite(value):
        return
    laws = work[3]
    for iteration in range(iterations):
        report[2] = iteration + 1.0
        bounds_of(low, high, values, layout)
        chain(slopes, values, x, layout, low, high)
        inside = (
            math.log(laws[0, 6]) + 1e-9,
            math.log(laws[0, 7]) - 1e-9,
        )
        linearise(
            matrix,
            values,
            slopes,
            best[0, :, 0],
            frames,
            inside,
            gain,
            background,
            *instrument,
        )
        for j in range(d):
            # what a bound holds against the gradient stays where it is
            gradient, square = 0.0, 0.0
            for i in range(n * m):
                gradient += matrix[i, j] * matrix[i, d]
                square += matrix[i, j] ** 2
            held = (x[j] <= low[j] and gradient < 0.0) or (x[j] >= high[j] and gradient > 0.0)
            scale[j] = 0.0 if held else math.sqrt(square)
            if scale[j] == 0.0:
                for i in range(n * m):
                    matrix[i, j] = 0.0
        triangularise(matrix, d)
        triangle[:] = 0.0
        remaining = 0.0
        for i in range(min(d, n * m)):
            for j in range(i, d + 1):
                triangle[i, j] = matrix[i, j]
            remaining += matrix[i, d] ** 2
        report[1] = remaining
        if not math.isfinite(remaining):
            return
        if remaining < _ENOUGH:
            return
        moved = False
        for _ in range(_TRIES):
            damped_step(step, triangle, scale, damping)
            for j in range(d):
                trial[j] = x[j] + min(max(step[j], -_LONGEST), _LONGEST)
            _free_crosstalk(trial, x, step, layout)
            good = True
            for j in range(d):
                good = good and math.isfinite(trial[j])
            if good:
                for j in range(d):
                    trial[j] = min(max(trial[j], low[j]), high[j])
                good = physical(trial_values, trial, layout)
            trial_value = math.inf
            if good:
                trial_value = deviance(
                    trial_best,
                    trial_values,
                    work[0],
                    work[1],
                    work[2],
                    work[3],
                    nearest,
                    gain,
                    frames,
                    present,
                    instrument,
                )
            if trial_value < value:
                moved = True
                break
            damping = max(damping * 6.0, 1e-9)
        if not moved:
            return
        value = trial_value
        x[:] = trial
        values[:] = trial_values
        best[:] = trial_best
        laws[0, 6] = nearest
        if background is not None:
            laws[0, 6] = max(nearest, -values[8])
        damping = max(damping * 0.15, 1e-14)
        report[0], report[3] = value, damping


@compiled
def _free_crosstalk(trial: Array, x: Array, step: Array, layout: Layout) -> None:
    """Undo the limit of the step where a coordinate is no logarithm."""
    for k in (3, 4):
        j = layout[0][k]
        if j >= 0:
            trial[j] = x[j] + step[j]
