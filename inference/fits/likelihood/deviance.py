"""The deviance of a scene, with every range at its best value."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import Pair, log_top
from inference.density.integrand import log_integrand, slope_and_curvature
from inference.density.profile import fill_best_ranges
from inference.density.rows import background_of, crosstalk_of, law_of
from simulator.compiled import compiled

__all__ = ["Instrument", "deviance"]

Array = NDArray[np.float64]

# r0, wave, read, shot, relative
Instrument = tuple[float, Pair | None, Pair, float | None, float | None]
_TRIES = 12
_SETTLED = 1e-7  # deviance that a range may lack of its best value
_KNOTS = 0.04  # about their distance in `inference.density.curve_table`


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
