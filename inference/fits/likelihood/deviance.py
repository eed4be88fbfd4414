"""The deviance of a scene, with every range at its best value."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.best_ranges import fill_best_ranges
from inference.fits.likelihood.arguments import Fit, Place
from inference.fits.likelihood.coordinates import physical
from inference.frame.arguments import RangePrior, scene_of
from inference.frame.blocks import block_of
from inference.frame.gaussian import log_top
from inference.frame.log_density import log_density, slope_and_curvature
from inference.frame.sensitivity import Value
from simulator.assign import assign
from simulator.compiled import compiled

__all__ = ["POSITION", "TOP", "deviance", "nearest_range", "open_values"]

Array = NDArray[np.float64]

POSITION, TOP = 0, 1  # of a frame in `Place.best`
_LOW = RangePrior._fields.index("low")
_TRIES = 12
_SETTLED = 1e-7  # deviance that a range may lack of its best value
_KNOTS = 0.04  # about their distance in `inference.frame.table`


@compiled
def _settle(best: Array, fit: Fit) -> None:
    """Follow modes to their very top by Newton steps.

    An integral is content with a mode to a fraction of its width; where the readings barely move
    with the range but lie far from the model, the width from first derivatives says little, and a
    gradient needs the top.
    """
    scene, data = scene_of(fit.rows, fit.instrument, 0), fit.data
    low, high = math.log(scene.range_prior.low), math.log(scene.range_prior.high)
    for j in range(best.shape[1]):
        if not math.isfinite(best[0, j, POSITION]):  # without an object
            continue
        block = block_of(data, j)
        u = best[0, j, POSITION]
        slope, curvature = slope_and_curvature(u, block, scene)
        if slope * slope <= _SETTLED * curvature:
            continue
        density = log_density(u, block, scene)
        for _ in range(_TRIES):
            width = 1e-5
            ahead, _ = slope_and_curvature(u + width, block, scene)
            bend = max((slope - ahead) / width, 1e-3 * curvature, 1e-12)
            step = min(max(slope / bend, -_KNOTS), _KNOTS)
            while abs(step) > 1e-13:
                trial = min(max(u + step, low), high)
                value = log_density(trial, block, scene)
                if value >= density:
                    break
                step *= 0.25
            if not abs(step) > 1e-13 or trial == u:
                break
            u, density = trial, value
            slope, curvature = slope_and_curvature(u, block, scene)
            if abs(slope * step) < _SETTLED:
                break
        best[0, j, POSITION] = u
        best[0, j, TOP] = density + log_top(fit.instrument.read)


@compiled
def nearest_range(values: Array, nearest: float, background: bool | None) -> float:
    """Return the least range at given physical values, ``nearest`` that of the scene [m]."""
    if background is not None:
        # nearer than -c1' a shadow is negative
        return max(nearest, -float(values[Value.SHADOW_C1]))
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return nearest


@compiled
def _put(row: Array | None, values: Array) -> None:
    if row is not None:
        assign(row[0], values)


@compiled
def open_values(values: Array, fit: Fit) -> None:
    """Put physical values into the work space of a fit."""
    rows, near = fit.rows, fit.support[0]
    rows.shapes[0, 0] = fit.gain * values[Value.C0] * values[Value.C2]
    rows.shapes[0, 1], rows.shapes[0, 2] = values[Value.C0], values[Value.C1]
    rows.range_priors[0, _LOW] = nearest_range(values, near, fit.background)
    _put(rows.crosstalks, values[Value.CROSSTALK_1 : Value.STRENGTH])
    _put(rows.backgrounds, values[Value.STRENGTH : Value.LOG_RANGE])


@compiled
def deviance(place: Place, fit: Fit) -> float:
    """Return -2 log likelihood at the best ranges, relative to no residual under read noise alone.

    Parameters
    ----------
    place : Place
        Its coordinates are read, the rest is filled.
    fit : Fit
        The fit.

    Returns
    -------
    float
        inf where the coordinates have no likelihood.
    """
    if not physical(place.values, place.x, fit.layout):
        return math.inf
    open_values(place.values, fit)
    instrument, best = fit.instrument, place.best
    fill_best_ranges(best, fit.rows, fit.data, instrument)
    _settle(best, fit)
    total = 0.0
    top = log_top(instrument.read)
    for j in range(best.shape[1]):
        total -= 2.0 * (best[0, j, TOP] - top)
    return total if math.isfinite(total) else math.inf
