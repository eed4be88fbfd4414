"""The gradient of the deviance, ranges eliminated."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.coordinates import Layout, bounds_of, chain, physical
from inference.fits.likelihood.deviance import deviance
from inference.fits.likelihood.linearisation import linearise
from inference.fits.likelihood.slopes import SLOTS
from simulator.compiled import compiled

__all__ = ["profile_slopes"]

Array = NDArray[np.float64]


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
