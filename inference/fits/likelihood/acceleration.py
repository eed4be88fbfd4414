"""How residuals bend along a step, so that a climb follows curved valleys.

A step of least squares is a straight line; where the model bends along it, most of a long step is
lost on the wall of the valley. The second derivative of the residuals along the step, ranges
following, gives the acceleration of the path that the step begins: the step and half of it follow
the valley to second order (Transtrum and Sethna 2012, "Improvements to the Levenberg-Marquardt
algorithm", "geodesic acceleration").
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import SLOTS, Bounds, Fit, Place
from inference.fits.likelihood.coordinates import chain, physical
from inference.fits.likelihood.deviance import POSITION
from inference.fits.likelihood.linearisation import frame_rows, room_for_rows, yielding_ranges
from inference.frame.sensitivity import Value
from simulator.compiled import compiled

__all__ = ["fill_bending"]

Array = NDArray[np.float64]

_STEP = 0.1  # of the whole step: second differences of smooth residuals


@compiled
def fill_bending(out: Array, step: Array, place: Place, bounds: Bounds, fit: Fit) -> bool:
    """Fill the second derivative of the projected residuals along a step.

    Parameters
    ----------
    out : ndarray, shape (`linearisation.rows_of` the frames,)
        Filled; 0 in rows of what the covariance tells.
    step : ndarray, shape (d,)
        Of the coordinates; the ranges follow to first order.
    place : Place
        From `deviance`.
    bounds : Bounds
        There.
    fit : Fit
        The fit.

    Returns
    -------
    bool
        Whether all of it is finite.
    """
    n, d = fit.data.frames.shape[0], step.size
    chained, along = np.empty((SLOTS, d)), np.zeros(SLOTS)
    chain(chained, place.values, place.x, fit.layout, bounds)
    for k in range(SLOTS):
        for j in range(d):
            along[k] += chained[k, j] * step[j]
    ahead, behind = np.empty(SLOTS), np.empty(SLOTS)
    good = physical(ahead, place.x + _STEP * step, fit.layout)
    good = physical(behind, place.x - _STEP * step, fit.layout) and good
    if not good:
        return False
    slopes, rows = room_for_rows()
    low, high = yielding_ranges(place.values, fit)
    m = out.size // n
    out[:] = 0.0
    for i in range(n):
        u = place.best[0, i, POSITION]
        frame_rows(rows, slopes, i, u, place.values, fit)
        r1, r2 = rows[0, Value.LOG_RANGE], rows[1, Value.LOG_RANGE]
        square = r1 * r1 + r2 * r2
        follow = 0.0
        moves = math.isfinite(u) and square > 0.0 and low < u < high
        if moves:
            for k in range(SLOTS):
                follow -= (r1 * rows[0, k] + r2 * rows[1, k]) * along[k]
            follow /= square
        e1, e2 = -2.0 * rows[0, Value.READINGS], -2.0 * rows[1, Value.READINGS]
        for side in range(2):
            values = ahead if side == 0 else behind
            sign = _STEP if side == 0 else -_STEP
            frame_rows(rows, slopes, i, u + sign * follow, values, fit)
            e1 += rows[0, Value.READINGS]
            e2 += rows[1, Value.READINGS]
        if moves:
            lost = (r1 * e1 + r2 * e2) / square
            e1, e2 = e1 - lost * r1, e2 - lost * r2
        out[i * m], out[i * m + 1] = e1 / (_STEP * _STEP), e2 / (_STEP * _STEP)
        good = good and math.isfinite(e1) and math.isfinite(e2)
    return good
