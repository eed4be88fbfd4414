"""What the filter says of a frame."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import (
    COUNT,
    CROSSTALK1,
    CROSSTALK2,
    Hypotheses,
    U,
    V,
    learns_crosstalk,
)
from inference.tracking.motion import Rules
from simulator.compiled import compiled

__all__ = [
    "BEST",
    "CROSSTALK",
    "HYPOTHESES",
    "HYPOTHESIS_COLUMNS",
    "LASTING",
    "MODEL_SD",
    "OUTLIER",
    "OUTLIERS_RUN",
    "POSITION",
    "PRESENT",
    "RATE",
    "RATE_SD",
    "REPORT_COLUMNS",
    "SCENE_SD",
    "SD",
    "STATUS",
    "STUCK",
    "SURPRISE",
    "UNSTEADY_MEAN",
    "WEIGHT",
    "report",
]

Array = NDArray[np.float64]

# columns of a report
STATUS, PRESENT, OUTLIER, SURPRISE, HYPOTHESES, BEST = range(6)
CROSSTALK, UNSTEADY_MEAN, LASTING, OUTLIERS_RUN, STUCK, REPORT_COLUMNS = 12, 16, 17, 18, 19, 20
# columns of a hypothesis, and of the best range: u, its sd, the parts of it that all frames share
# because the scene and because the model may be wrong, rate, its sd, weight (of the best range
# given that an object is there)
POSITION, SD, SCENE_SD, MODEL_SD, RATE, RATE_SD, WEIGHT, HYPOTHESIS_COLUMNS = range(8)
_UNIQUE, _AMBIGUOUS, _NONE = int(Status.UNIQUE), int(Status.AMBIGUOUS), int(Status.NONE)


@compiled
def _describe(row: Array, of: Hypotheses, j: int, from_scene: int) -> None:
    """Fill one row of the hypotheses."""
    x, X = of.x, of.X
    own, scene, model, rate = 0.0, 0.0, 0.0, 0.0
    n = X.shape[1]
    for k in range(X.shape[-1]):
        square = X[j, U, k] * X[j, U, k]
        if k >= n + from_scene:
            model += square
        elif k >= n:
            scene += square
        own += square
        rate += X[j, V, k] * X[j, V, k]
    row[POSITION], row[SD] = x[j, U], math.sqrt(own)
    row[SCENE_SD], row[MODEL_SD] = math.sqrt(scene), math.sqrt(model)
    row[RATE], row[RATE_SD], row[WEIGHT] = x[j, V], math.sqrt(rate), of.weight[j]


@compiled
def _pool(out: Array, rows: Array, i: int, first: int, last: int, total: float) -> None:
    """Fill the mean and standard deviations of a group of hypotheses."""
    u, scene, model, rate = 0.0, 0.0, 0.0, 0.0
    for j in range(first, last):
        share = rows[i, j, WEIGHT] / total
        u += share * (rows[i, j, POSITION] - rows[i, first, POSITION])
        scene += share * rows[i, j, SCENE_SD]
        model += share * rows[i, j, MODEL_SD]
        rate += share * rows[i, j, RATE]
    u += rows[i, first, POSITION]
    square, rate_square = 0.0, 0.0
    for j in range(first, last):
        share = rows[i, j, WEIGHT] / total
        sd, off = rows[i, j, SD], rows[i, j, POSITION] - u
        square += share * (sd * sd + off * off)
        rate_sd, rate_off = rows[i, j, RATE_SD], rows[i, j, RATE] - rate
        rate_square += share * (rate_sd * rate_sd + rate_off * rate_off)
    out[i, BEST + POSITION], out[i, BEST + SD] = u, math.sqrt(square)
    out[i, BEST + SCENE_SD], out[i, BEST + MODEL_SD] = scene, model
    out[i, BEST + RATE], out[i, BEST + RATE_SD] = rate, math.sqrt(rate_square)


@compiled
def _describe_crosstalk(out: Array, i: int, of: Hypotheses) -> None:
    """Fill mean and standard deviation of the crosstalk over all hypotheses."""
    x, X, weight = of.x, of.X, of.weight
    for k, state in enumerate((CROSSTALK1, CROSSTALK2)):
        mean, square, total = 0.0, 0.0, 0.0
        for j in range(int(of.numbers[COUNT]) + 1):
            variance = 0.0
            for c in range(X.shape[-1]):
                variance += X[j, state, c] * X[j, state, c]
            gap = x[j, state] - x[0, state]
            mean += weight[j] * gap
            square += weight[j] * (variance + gap * gap)
            total += weight[j]
        mean, square = mean / total, square / total
        out[i, CROSSTALK + k] = x[0, state] + mean
        out[i, CROSSTALK + 2 + k] = math.sqrt(max(square - mean * mean, 0.0))


@compiled
def _sort_in(rows: Array, of: Hypotheses, count: int, from_scene: int) -> None:
    """Fill rows by ascending range, by insertion."""
    for j in range(1, count + 1):
        at = j - 1
        while at > 0 and rows[at - 1, POSITION] > of.x[j, U]:
            for k in range(HYPOTHESIS_COLUMNS):
                rows[at, k] = rows[at - 1, k]
            at -= 1
        _describe(rows[at], of, j, from_scene)


@borrowed
@compiled
def report(out: Array, rows: Array, i: int, of: Hypotheses, rules: Rules) -> None:
    """Describe the state after frame i.

    Parameters
    ----------
    out : ndarray, shape (frames, REPORT_COLUMNS)
        Status, probability that an object is there, number of hypotheses, best range, learnt
        crosstalk and its standard deviations in units of the noise are filled in; the latter two
        stay nan where there is none.
    rows : ndarray, shape (frames, capacity, HYPOTHESIS_COLUMNS)
        The hypotheses, by ascending range.
    i : int
        The frame.
    of : Hypotheses
        The state.
    rules : Rules
        From what weight on a range is unique, and which nuisance parameters are the scene's.
    """
    count, weight = int(of.numbers[COUNT]), of.weight
    out[i, PRESENT], out[i, HYPOTHESES], out[i, STATUS] = 1.0 - weight[0], count, _NONE
    _sort_in(rows[i], of, count, rules.from_scene)
    if learns_crosstalk(of):
        _describe_crosstalk(out, i, of)
    if weight[0] > 0.5 or count == 0:
        return
    # neighbours that overlap are one range; a mean is never taken over two that do not
    heaviest, begin, group = -1.0, 0, 0.0
    best_begin, best_end = 0, 0
    for j in range(count):
        if j > 0:
            gap = rows[i, j, POSITION] - rows[i, j - 1, POSITION]
            if gap > rows[i, j, SD] + rows[i, j - 1, SD]:
                begin, group = j, 0.0
        group += rows[i, j, WEIGHT]
        if group > heaviest:
            heaviest, best_begin, best_end = group, begin, j + 1
    _pool(out, rows, i, best_begin, best_end, heaviest)
    out[i, BEST + WEIGHT] = heaviest / (1.0 - weight[0])
    unique = heaviest > rules.unique_above * (1.0 - weight[0])
    out[i, STATUS] = _UNIQUE if unique else _AMBIGUOUS
