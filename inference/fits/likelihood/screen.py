"""Starting points that need no guess: most coordinates drawn, the linear ones solved from the data.

Crosstalk, c2 and the background's strength are linear in the readings once ranges are given. A few
frames (anchors) get drawn ranges; least squares over their readings gives the linear unknowns, and
all frames at their best ranges judge the whole.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS, Bounds, Fit, Layout, Place
from inference.fits.likelihood.coordinates import move_inside, physical
from inference.fits.likelihood.deviance import TOP, deviance
from inference.fits.likelihood.triangle import solve_least_squares
from inference.frame.gaussian import log_top
from inference.frame.sensitivity import SLOPES, Value, fill_slopes
from simulator.compiled import compiled

__all__ = ["screen"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_LINEAR = (Value.C2, Value.CROSSTALK_1, Value.CROSSTALK_2, Value.STRENGTH)
_GAIN = 2  # column of the frames
_TOLERANCE = 0.1  # of an anchor's reading against the farthest one's: the drawn ranges are guesses


@compiled
def _linear_unknowns(index: Indices) -> Indices:
    """Return which physical values are unknown and linear in the readings."""
    found = np.empty(len(_LINEAR), dtype=np.int64)
    count = 0
    for k in _LINEAR:
        if index[k] >= 0:
            found[count] = k
            count += 1
    return found[:count]


@compiled
def _equations(values: Array, ranges: Array, anchors: Indices, linear: Indices, fit: Fit) -> Array:
    """Return the anchors' readings as equations of the linear unknowns, the last column constant.

    The last anchor is the one with the least light.
    """
    frames, read = fit.data.frames, fit.instrument.read
    matrix = np.empty((2 * anchors.size, linear.size + 1))
    slopes = np.empty((SLOPES, 4))
    darkest = anchors[anchors.size - 1]
    for a in range(anchors.size):
        frame = anchors[a]
        factor = frames[frame, _GAIN]
        fill_slopes(slopes, ranges[a], values, fit.gain, factor, fit.background, fit.instrument)
        for side in range(2):
            row = matrix[2 * a + side]
            rest = frames[frame, side] - slopes[Value.READINGS, side]
            for c in range(linear.size):
                k = linear[c]
                row[c] = slopes[k, side]
                rest += values[k] * slopes[k, side]
            row[linear.size] = rest
            spread = abs(frames[frame, side] - frames[darkest, side])
            row *= 1.0 / (_TOLERANCE * spread + read[side])
    return matrix


@compiled
def _take_over(
    place: Place, solution: Array, linear: Indices, bounds: Bounds, layout: Layout
) -> None:
    """Put solved values into the coordinates, as far as they are physical."""
    x, values = place.x, place.values
    for c in range(linear.size):
        k = linear[c]
        j = layout.coordinate[k]
        if k in CROSSTALK:
            x[j] = solution[c]
        elif solution[c] > 0.0:
            x[j] = math.log(solution[c])
    physical(values, x, layout)
    for c in range(linear.size):
        k = linear[c]
        j = layout.coordinate[k]
        if k in CROSSTALK:  # to the static light: what its physical value has lost is added
            x[j] += x[j] - values[k]
        if not math.isfinite(x[j]):
            x[j] = math.nan
        x[j] = min(max(x[j], bounds.low[j]), bounds.high[j])


@compiled
def screen(points: Array, scores: Array, ranges: Array, anchors: Indices, fit: Fit) -> None:
    """Solve the linear unknowns of drawn points and score the points.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        Coordinates; linear ones are overwritten where the anchors give physical values.
    scores : ndarray, shape (n,)
        Filled: sum over frames of log(1 + chi-square), less is better; inf where not physical.
    ranges : ndarray, shape (n, anchors)
        Drawn log ranges of the anchors; nan for one without an object.
    anchors : ndarray of int, shape (anchors,)
        Their frames, the one with the least light last.
    fit : Fit
        The fit.
    """
    n, d = fit.data.frames.shape[0], points.shape[1]
    linear = _linear_unknowns(fit.layout.coordinate)
    values, best = np.empty(SLOTS), np.empty((1, n, 3))
    bounds, solution = Bounds(np.empty(d), np.empty(d)), np.empty(linear.size)
    top = log_top(fit.instrument.read)
    for i in range(points.shape[0]):
        scores[i] = math.inf
        place = Place(points[i], values, best)
        if not physical(values, place.x, fit.layout):
            continue
        if not move_inside(place, bounds, fit.layout):
            continue
        if 0 < linear.size <= 2 * anchors.size:
            matrix = _equations(values, ranges[i], anchors, linear, fit)
            solve_least_squares(solution, matrix)
            _take_over(place, solution, linear, bounds, fit.layout)
        if deviance(place, fit) < math.inf:
            scores[i] = 0.0
            for j in range(n):
                scores[i] += math.log1p(max(-2.0 * (best[0, j, TOP] - top), 0.0))
