"""The deviance of a scene, with every range at its best value."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import log_top
from inference.density.integrand import log_integrand, slope_and_curvature
from inference.density.profile import fill_best_ranges
from inference.density.rows import background_of, crosstalk_of, law_of
from inference.fits.likelihood.arguments import Fit, Place
from inference.fits.likelihood.coordinates import physical
from inference.frame.arguments import Instrument, RangePrior
from inference.frame.sensitivity import Value
from simulator.compiled import compiled

__all__ = ["POSITION", "TOP", "deviance", "nearest_range", "open_values"]

Array = NDArray[np.float64]

POSITION, TOP = 0, 1  # of a frame in `Place.best`
_LOW = RangePrior._fields.index("low")
_TRIES = 12
_SETTLED = 1e-7  # deviance that a range may lack of its best value
_KNOTS = 0.04  # about their distance in `inference.density.curve_table`


@compiled
def _settle(
    best: Array,
    shapes: Array,
    crosstalks: Array | None,
    backgrounds: Array | None,
    laws: Array,
    frames: Array,
    instrument: Instrument,
) -> None:
    """Follow modes to their very top by Newton steps.

    An integral is content with a mode to a fraction of its width; where the readings barely move
    with the range but lie far from the model, the width from first derivatives says little, and a
    gradient needs the top.
    """
    shape = (shapes[0, 0], shapes[0, 1], shapes[0, 2])
    crosstalk, background = crosstalk_of(crosstalks, 0), background_of(backgrounds, 0)
    law = law_of(laws, 0)
    r0, wave, read, shot, relative = instrument
    scene = (shape, crosstalk, background, law, r0, wave, read, shot, relative, None)
    low, high = math.log(law[6]), math.log(law[7])
    for j in range(frames.shape[0]):
        if not math.isfinite(best[0, j, POSITION]):  # without an object
            continue
        frame = (frames[j, 0], frames[j, 1], frames[j, 2])
        u = best[0, j, POSITION]
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
        best[0, j, POSITION] = u
        best[0, j, TOP] = density + log_top(read)


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
        row[0, :] = values


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
    rows, data, instrument, best = fit.rows, fit.data, fit.instrument, place.best
    r0, wave, read, shot, relative = instrument
    fill_best_ranges(
        best,
        rows.shapes,
        rows.crosstalks,
        rows.backgrounds,
        rows.range_priors,
        data.frames,
        data.present,
        r0,
        wave,
        read,
        shot,
        relative,
    )
    _settle(
        best,
        rows.shapes,
        rows.crosstalks,
        rows.backgrounds,
        rows.range_priors,
        data.frames,
        instrument,
    )
    total = 0.0
    top = log_top(instrument.read)
    for j in range(best.shape[1]):
        total -= 2.0 * (best[0, j, TOP] - top)
    return total if math.isfinite(total) else math.inf
