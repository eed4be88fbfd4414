"""Starting points that need no guess: most coordinates drawn, the linear ones solved from the data.

Crosstalk, c2 and the background's strength are linear in the readings once ranges are given. A few
frames (anchors) get drawn ranges; least squares over their readings gives the linear unknowns, and
all frames at their best ranges judge the whole.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.density.gaussian import log_top
from inference.fits.likelihood.coordinates import Layout, bounds_of, physical
from inference.fits.likelihood.deviance import deviance
from inference.fits.likelihood.slopes import SLOTS, frame_slopes
from inference.fits.likelihood.triangle import solve_least_squares
from simulator.compiled import compiled

__all__ = ["LINEAR", "screen"]

Array = NDArray[np.float64]

LINEAR = (2, 3, 4, 5)  # slots in which readings are linear
_TOLERANCE = 0.1  # of an anchor's reading against the farthest one's: the drawn ranges are guesses


@compiled
def screen(
    points: Array,
    scores: Array,
    ranges: Array,
    anchors: NDArray[np.int64],
    layout: Layout,
    work: Any,
    nearest: float,
    gain: float,
    background: bool | None,
    frames: Array,
    present: NDArray[np.bool_],
    instrument: Any,
) -> None:
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
    layout, work, nearest, gain, background, frames, present, instrument
        As for `climb`.
    """
    index = layout[0]
    count = 0
    slots = np.empty(4, dtype=np.int64)
    for k in (2, 3, 4, 5):
        if index[k] >= 0:
            slots[count] = k
            count += 1
    values = np.ones(SLOTS + 1)
    d = points.shape[1]
    low, high = np.empty(d), np.empty(d)
    slopes = np.empty((SLOTS + 2, 4))
    rows = 2 * anchors.size
    solution = np.empty(count)
    best = np.empty((1, frames.shape[0], 3))
    darkest = anchors[anchors.size - 1]
    top = log_top(instrument[2])
    for i in range(points.shape[0]):
        scores[i] = math.inf
        x = points[i]
        if not physical(values, x, layout):
            continue
        bounds_of(low, high, values, layout)
        for j in range(d):
            x[j] = min(max(x[j], low[j]), high[j])
        if not physical(values, x, layout):
            continue
        if count > 0 and rows >= count:
            matrix = np.zeros((rows, count + 1))
            for a in range(anchors.size):
                frame = anchors[a]
                values[SLOTS] = frames[frame, 2]
                frame_slopes(
                    slopes, ranges[i, a], values, gain, background, instrument[0], instrument[1]
                )
                for side in range(2):
                    row = 2 * a + side
                    rest = frames[frame, side] - slopes[SLOTS + 1, side]
                    for c in range(count):
                        k = slots[c]
                        matrix[row, c] = slopes[k, side]
                        rest += values[k] * slopes[k, side]
                    matrix[row, count] = rest
                    spread = abs(frames[frame, side] - frames[darkest, side])
                    weight = 1.0 / (_TOLERANCE * spread + instrument[2][side])
                    for c in range(count + 1):
                        matrix[row, c] *= weight
            solve_least_squares(solution, matrix)
            for c in range(count):
                k = slots[c]
                j = index[k]
                if k == 3 or k == 4:
                    x[j] = solution[c]
                elif solution[c] > 0.0:
                    x[j] = math.log(solution[c])
                if not math.isfinite(x[j]):
                    x[j] = math.nan
                x[j] = min(max(x[j], low[j]), high[j])
            if not physical(values, x, layout):
                continue
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
        if value < math.inf:
            total = 0.0
            for j in range(frames.shape[0]):
                total += math.log1p(max(-2.0 * (best[0, j, 1] - top), 0.0))
            scores[i] = total
