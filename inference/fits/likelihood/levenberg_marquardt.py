"""Levenberg-Marquardt over everything unknown, with every range at its best value all the way."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.acceleration import fill_bending
from inference.fits.likelihood.arguments import CROSSTALK, Bounds, Fit, Place
from inference.fits.likelihood.coordinates import move_inside
from inference.fits.likelihood.deviance import deviance
from inference.fits.likelihood.linearisation import fill_projected, rows_of
from inference.fits.likelihood.triangle import damped_step, reduce_columns
from simulator.assign import assign
from simulator.compiled import compiled

__all__ = ["Climbed", "levenberg_marquardt"]

Array = NDArray[np.float64]

_LONGEST = 1.5  # of a step in a logarithm: a factor of 4.5
_TRIES = 12
_ENOUGH = 1e-4  # deviance that a whole Newton step would still gain
# damping to begin with, its factors after a step that helps and one that does not, and the least
_DAMPING, _EASED, _RAISED, _LEAST = 1e-3, 0.15, 6.0, 1e-14
_FIRST = 1e-9  # damping to which a failing step raises it at least
_BENT = 0.75  # of a step: an acceleration above it says that second order is not enough


class Climbed(NamedTuple):
    """Where a climb ended: deviance, and what a whole Newton step would still gain of it."""

    deviance: float
    remaining: float


class _System(NamedTuple):
    """The linear system of a step.

    Attributes
    ----------
    projected, matrix : ndarray, shape (rows, d + 1)
        Projected rows, and room in which they are reduced.
    triangle : ndarray, shape (d, d + 1)
        What a reduction leaves of them.
    scale : ndarray, shape (d,)
        Column norms; 0 of a coordinate that stays.
    """

    projected: Array
    matrix: Array
    triangle: Array
    scale: Array


@compiled
def _reduce(system: _System) -> float:
    """Reduce the projected rows; return what least squares takes off the square of the last."""
    projected, matrix, triangle, _ = system
    rows, d = matrix.shape[0], triangle.shape[0]
    assign(matrix, projected)
    reduce_columns(matrix, d)
    triangle[:] = 0.0
    taken = 0.0
    for i in range(min(d, rows)):
        for j in range(i, d + 1):
            triangle[i, j] = matrix[i, j]
        taken += matrix[i, d] * matrix[i, d]
    return taken


@compiled
def _linearise(system: _System, place: Place, bounds: Bounds, fit: Fit) -> float:
    """Fill bounds and system at a place; return the deviance that a whole step would gain."""
    matrix, scale = system.projected, system.scale
    rows, d = matrix.shape[0], scale.size
    fill_projected(matrix, place, bounds, fit)
    for j in range(d):
        # what a bound holds against the gradient stays where it is
        gradient, square = 0.0, 0.0
        for i in range(rows):
            gradient += matrix[i, j] * matrix[i, d]
            square += matrix[i, j] * matrix[i, j]
        x = place.x[j]
        fixed = (x <= bounds.low[j] and gradient < 0.0) or (x >= bounds.high[j] and gradient > 0.0)
        scale[j] = 0.0 if fixed else math.sqrt(square)
        if scale[j] == 0.0:
            for i in range(rows):
                matrix[i, j] = 0.0
    return _reduce(system)


@compiled
def _accelerate(
    step: Array,
    bent: _System,
    system: _System,
    damping: float,
    place: Place,
    bounds: Bounds,
    fit: Fit,
) -> None:
    """Add half the acceleration of the path that a step begins, where it is small enough."""
    d = step.size
    assign(bent.projected, system.projected)
    assign(bent.scale, system.scale)
    if not fill_bending(bent.projected[:, d], step, place, bounds, fit):
        return
    _reduce(bent)
    more = np.empty(d)
    damped_step(more, bent.triangle, system.scale, damping)
    size, change = 0.0, 0.0
    for j in range(d):
        length, added = system.scale[j] * step[j], system.scale[j] * more[j]
        size += length * length
        change += added * added
    if change <= _BENT * _BENT * size:
        for j in range(d):
            step[j] += 0.5 * more[j]


@compiled
def _room(rows: int, d: int) -> _System:
    matrix = np.empty((rows, d + 1))
    return _System(matrix, np.empty_like(matrix), np.empty((d, d + 1)), np.empty(d))


@compiled
def _step_to(trial: Place, x: Array, step: Array, bounds: Bounds, fit: Fit) -> float:
    """Take a step of limited length within the bounds; return the deviance there."""
    for j in range(x.size):
        trial.x[j] = x[j] + min(max(step[j], -_LONGEST), _LONGEST)
    for k in CROSSTALK:
        j = fit.layout.coordinate[k]
        if j >= 0:  # no logarithm: no limit
            trial.x[j] = x[j] + step[j]
    for j in range(x.size):
        if not math.isfinite(trial.x[j]):
            return math.inf
        trial.x[j] = min(max(trial.x[j], bounds.low[j]), bounds.high[j])
    return deviance(trial, fit)


@compiled
def levenberg_marquardt(place: Place, fit: Fit, steps: int) -> Climbed:
    """Climb towards a maximum of the likelihood.

    Parameters
    ----------
    place : Place
        Its coordinates are the start; moved to the end point, and filled there.
    fit : Fit
        The fit.
    steps : int
        At most so many.

    Returns
    -------
    Climbed
        Its deviance is inf where the start has no likelihood.
    """
    d, rows = place.x.size, rows_of(place.best.shape[1], fit.instrument)
    bounds, step = Bounds(np.empty(d), np.empty(d)), np.empty(d)
    trial = Place(np.empty(d), np.empty_like(place.values), np.empty_like(place.best))
    system, bent = _room(rows, d), _room(rows, d)
    value, remaining, damping = math.inf, math.inf, _DAMPING
    if move_inside(place, bounds, fit.layout):
        value = deviance(place, fit)
    if not math.isfinite(value):
        return Climbed(value, remaining)
    for _ in range(steps):
        remaining = _linearise(system, place, bounds, fit)
        if not math.isfinite(remaining) or remaining < _ENOUGH:
            break
        reached = math.inf
        for _ in range(_TRIES):
            damped_step(step, system.triangle, system.scale, damping)
            _accelerate(step, bent, system, damping, place, bounds, fit)
            reached = _step_to(trial, place.x, step, bounds, fit)
            if reached < value:
                break
            damping = max(damping * _RAISED, _FIRST)
        if not reached < value:
            break
        value = reached
        assign(place.x, trial.x)
        assign(place.values, trial.values)
        assign(place.best, trial.best)
        damping = max(damping * _EASED, _LEAST)
    return Climbed(value, remaining)
