"""Levenberg-Marquardt over everything unknown, with every range at its best value all the way."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import Pair, log_top
from inference.density.integrand import log_integrand, slope_and_curvature
from inference.density.profile import fill_best_ranges
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.multiframe.coordinates import Layout, bounds_of, chain, physical
from inference.multiframe.linearisation import linearise
from inference.multiframe.slopes import SLOTS
from inference.multiframe.triangle import damped_step, triangularise
from simulator.compiled import compiled

__all__ = ["Instrument", "climb", "deviance", "profile_slopes"]

Array = NDArray[np.float64]
# r0, wave, read, shot, relative
Instrument = tuple[float, Pair | None, Pair, float | None, float | None]

_LONGEST = 1.5  # of a step in a logarithm: a factor of 4.5
_ENOUGH = 1e-4  # deviance that a whole Newton step would still gain
_TRIES = 12
_SETTLED = 1e-7  # deviance that a range may lack of its best value
_KNOTS = 0.04  # about their distance in `inference.density.frame_integral`


@compiled
def _settle(
    best: Array,
    shapes: Array,
    crosstalks: Array,
    backgrounds: Array | None,
    laws: Array,
    frames: Array,
    present: NDArray[np.bool_],
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
) -> None:
    """Follow modes to their very top by Newton steps.

    An integral is content with a mode to a fraction of its width; where the readings barely move
    with the range but lie far from the model, the width from first derivatives says little, and a
    gradient needs the top.
    """
    shape = (shapes[0, 0], shapes[0, 1], shapes[0, 2])
    crosstalk, background = crosstalk_of(crosstalks, 0), background_of(backgrounds, 0)
    law = law_of(laws, 0)
    scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
    low, high = math.log(law[6]), math.log(law[7])
    for j in range(frames.shape[0]):
        if not present[j] or not math.isfinite(best[0, j, 0]):
            continue
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        u = best[0, j, 0]
        slope, curvature = slope_and_curvature(u, frame, *scene)
        if slope * slope <= _SETTLED * curvature:
            continue
        density = log_integrand(u, frame, *scene)
        for _ in range(_TRIES):
            width = 1e-5
            ahead, _ = slope_and_curvature(u + width, frame, *scene)
            bend = max((slope - ahead) / width, 1e-3 * curvature, 1e-12)
            step = min(max(slope / bend, -_KNOTS), _KNOTS)
            while abs(step) > 1e-13:
                trial = min(max(u + step, low), high)
                value = log_integrand(trial, frame, *scene)
                if value >= density:
                    break
                step *= 0.25
            if not abs(step) > 1e-13 or trial == u:
                break
            u, density = trial, value
            slope, curvature = slope_and_curvature(u, frame, *scene)
            if abs(slope * step) < _SETTLED:
                break
        best[0, j, 0] = u
        best[0, j, 1] = density + log_top(read)


@compiled
def deviance(
    best: Array,
    values: Array,
    shapes: Array,
    crosstalks: Array,
    backgrounds: Array | None,
    laws: Array,
    nearest: float,
    gain: float,
    frames: Array,
    present: NDArray[np.bool_],
    instrument: Any,
) -> float:
    """Return -2 log likelihood at the best ranges, relative to no residual under read noise alone.

    Parameters
    ----------
    best : ndarray, shape (1, frames, 3)
        Filled by `inference.density.profile`: log r, log density, standard deviation.
    values : ndarray
        Physical values of the slots.
    shapes, crosstalks, backgrounds, laws : ndarray
        Work space of one row each; ``backgrounds`` None without a background.
    nearest : float
        Least range of the support [m].
    gain, frames, present, instrument
        Sensor and data.
    """
    shapes[0, 0] = gain * values[0] * values[2]
    shapes[0, 1], shapes[0, 2] = values[0], values[1]
    crosstalks[0, 0], crosstalks[0, 1] = values[3], values[4]
    laws[0, 6] = nearest
    if backgrounds is not None:
        for k in range(4):
            backgrounds[0, k] = values[5 + k]
        # nearer than -c1' a shadow is negative
        laws[0, 6] = max(nearest, -values[8])
    fill_best_ranges(best, shapes, crosstalks, backgrounds, laws, frames, present, *instrument)
    _settle(best, shapes, crosstalks, backgrounds, laws, frames, present, *instrument)
    total = 0.0
    top = log_top(instrument[2])
    for j in range(frames.shape[0]):
        total -= 2.0 * (best[0, j, 1] - top)
    return total if math.isfinite(total) else math.inf


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
def profile_slopes(
    x: Array,
    best: Array,
    matrix: Array,
    layout: Layout,
    work: Any,
    nearest: float,
    gain: float,
    background: bool | None,
    frames: Array,
    present: NDArray[np.bool_],
    instrument: Any,
) -> float:
    """Return the deviance with every range at its best, and fill its projected rows.

    Their product with the residuals is minus half the gradient, to second order in what the
    ranges' best values lack.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Coordinates, within their bounds.
    best : ndarray, shape (1, frames, 3)
        Filled as by `climb`.
    matrix : ndarray, shape (frames * m, d + 1)
        Filled as by `linearisation.linearise`.
    layout, work, nearest, gain, background, frames, present, instrument
        As for `climb`.
    """
    d = x.size
    values, low, high = np.ones(SLOTS + 1), np.empty(d), np.empty(d)
    slopes = np.empty((SLOTS, d))
    if not physical(values, x, layout):
        return math.inf
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
    if not math.isfinite(value):
        return math.inf
    bounds_of(low, high, values, layout)
    chain(slopes, values, x, layout, low, high)
    inside = (math.log(work[3][0, 6]) + 1e-9, math.log(work[3][0, 7]) - 1e-9)
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
    return value


@compiled
def _free_crosstalk(trial: Array, x: Array, step: Array, layout: Layout) -> None:
    """Undo the limit of the step where a coordinate is no logarithm."""
    for k in (3, 4):
        j = layout[0][k]
        if j >= 0:
            trial[j] = x[j] + step[j]
