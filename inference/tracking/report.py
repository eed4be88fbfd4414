"""What the filter says of a frame."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.borrowed import borrowed
from inference.tracking.far_side import far_side_variance
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
from inference.tracking.readings_table import ReadingsTable
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
_ROOT_12 = math.sqrt(12.0)
# times as broad as the heaviest member of a group that another one may be
_BROADER = 10.0


class _Group(NamedTuple):
    """Hypotheses that are one range."""

    weight: float  # of all of them; negative where it is not one
    seed: int  # the heaviest
    # where they begin and end, those between that are far broader left out
    first: int
    last: int


@compiled
def _describe(row: Array, of: Hypotheses, j: int, from_scene: int, table: ReadingsTable) -> None:
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
    if learns_crosstalk(of):
        own += far_side_variance(of, j, table)
    # no range is beyond the support, and none is less known than anywhere within it
    row[POSITION] = min(max(x[j, U], table.start), table.end)
    most = (table.end - table.start) / _ROOT_12
    cut = min(1.0, most / math.sqrt(own)) if own > 0.0 else 1.0
    row[SD] = cut * math.sqrt(own)
    row[SCENE_SD], row[MODEL_SD] = cut * math.sqrt(scene), cut * math.sqrt(model)
    row[RATE], row[RATE_SD], row[WEIGHT] = x[j, V], math.sqrt(rate), of.weight[j]


@compiled
def _belongs(rows: Array, j: int, seed: int) -> bool:
    """Tell whether a hypothesis is narrow enough to be one range with a heavier one."""
    return bool(rows[j, SD] <= _BROADER * rows[seed, SD])


@compiled
def _around(rows: Array, count: int, seed: int) -> _Group:
    """Return the range around a hypothesis: neighbours that overlap are one.

    A mean is never taken over two that do not, nor with one that is far broader: however light, it
    would be all of the standard deviation. Of a range whose heaviest member is another the weight
    is negative.
    """
    weight, heaviest = rows[seed, WEIGHT], rows[seed, WEIGHT]
    first, last = seed, seed
    for side in range(2):
        end, step = (-1, -1) if side == 0 else (count, 1)
        at = seed
        for j in range(seed + step, end, step):
            if not _belongs(rows, j, seed):
                continue
            gap = abs(rows[j, POSITION] - rows[at, POSITION])
            if gap > rows[j, SD] + rows[at, SD]:
                break
            if rows[j, WEIGHT] > heaviest:
                return _Group(-1.0, seed, seed, seed)
            weight += rows[j, WEIGHT]
            first, last, at = min(first, j), max(last, j), j
    return _Group(weight, seed, first, last)


@compiled
def _pool(out: Array, rows: Array, i: int, group: _Group) -> None:
    """Fill the mean and standard deviations of a group of hypotheses."""
    u, scene, model, rate = 0.0, 0.0, 0.0, 0.0
    total, seed = group.weight, group.seed
    for j in range(group.first, group.last + 1):
        if not _belongs(rows, j, seed):
            continue
        share = rows[j, WEIGHT] / total
        u += share * (rows[j, POSITION] - rows[seed, POSITION])
        scene += share * rows[j, SCENE_SD]
        model += share * rows[j, MODEL_SD]
        rate += share * rows[j, RATE]
    u += rows[seed, POSITION]
    square, rate_square = 0.0, 0.0
    for j in range(group.first, group.last + 1):
        if not _belongs(rows, j, seed):
            continue
        share = rows[j, WEIGHT] / total
        sd, off = rows[j, SD], rows[j, POSITION] - u
        square += share * (sd * sd + off * off)
        rate_sd, rate_off = rows[j, RATE_SD], rows[j, RATE] - rate
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
def _sort_in(
    rows: Array, of: Hypotheses, count: int, from_scene: int, table: ReadingsTable
) -> None:
    """Fill rows by ascending range, by insertion."""
    for j in range(1, count + 1):
        at = j - 1
        while at > 0 and rows[at - 1, POSITION] > min(max(of.x[j, U], table.start), table.end):
            for k in range(HYPOTHESIS_COLUMNS):
                rows[at, k] = rows[at - 1, k]
            at -= 1
        _describe(rows[at], of, j, from_scene, table)


@compiled
def _take_heaviest(rows: Array, described: Array, count: int) -> int:
    """Fill rows with the heaviest that are described, in their order; how many."""
    taken = 0
    for j in range(count):
        heavier = 0
        if count > rows.shape[0]:
            for k in range(count):
                same = described[k, WEIGHT] == described[j, WEIGHT] and k < j
                heavier += int(described[k, WEIGHT] > described[j, WEIGHT] or same)
        if heavier < rows.shape[0]:
            for k in range(HYPOTHESIS_COLUMNS):
                rows[taken, k] = described[j, k]
            taken += 1
    return taken


@borrowed
@compiled
def report(
    out: Array,
    rows: Array,
    i: int,
    of: Hypotheses,
    rules: Rules,
    table: ReadingsTable,
    described: Array,
) -> None:
    """Describe the state after frame i.

    Parameters
    ----------
    out : ndarray, shape (frames, REPORT_COLUMNS)
        Status, probability that an object is there, number of hypotheses, best range, learnt
        crosstalk and its standard deviations in units of the noise are filled in; the latter two
        stay nan where there is none.
    rows : ndarray, shape (frames, capacity, HYPOTHESIS_COLUMNS)
        The heaviest hypotheses, by ascending range.
    i : int
        The frame.
    of : Hypotheses
        The state.
    rules : Rules
        From what weight on a range is unique, and which nuisance parameters are the scene's.
    table : ReadingsTable
        Which ranges there are.
    described : ndarray, shape (rows of the state, HYPOTHESIS_COLUMNS)
        Overwritten.
    """
    count, weight = int(of.numbers[COUNT]), of.weight
    out[i, PRESENT], out[i, STATUS] = 1.0 - weight[0], _NONE
    _sort_in(described, of, count, rules.from_scene, table)
    out[i, HYPOTHESES] = _take_heaviest(rows[i], described, count)
    if learns_crosstalk(of):
        _describe_crosstalk(out, i, of)
    if weight[0] > 0.5 or count == 0:
        return
    best = _Group(-1.0, 0, 0, 0)
    for seed in range(count):
        group = _around(described, count, seed)
        if group.weight > best.weight:
            best = group
    _pool(out, described, i, best)
    heaviest = best.weight
    out[i, BEST + WEIGHT] = heaviest / (1.0 - weight[0])
    unique = heaviest > rules.unique_above * (1.0 - weight[0])
    out[i, STATUS] = _UNIQUE if unique else _AMBIGUOUS
