"""The filter: frames in, weighted hypotheses out, one frame after the other.

A pure fold in machine code. It knows of the past what its arrays hold, so that the result does not
depend on how a stream is cut into batches.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status
from inference.tracking.curve import Curve, Places, mass_bound
from inference.tracking.hypotheses import (
    born_prior,
    expected_readings,
    learn,
    learn_empty,
    log_outlier,
    prior_of,
)
from inference.tracking.masses import CHOICE_COLUMNS
from inference.tracking.modes import find_choices
from inference.tracking.motion import Rules, motion_over, presence_over
from inference.tracking.report import OUTLIER, STATUS, SURPRISE, report
from inference.tracking.shared_error import ANCHOR, certainty
from inference.tracking.square_root import drop_lightest, merge, merge_equals, move
from simulator.compiled import compiled

__all__ = [
    "COUNT",
    "EMPTY",
    "EMPTY_SATURATED",
    "PENDING",
    "RUNNING",
    "SATURATED",
    "TIME",
    "USABLE",
    "run_filter",
]

Array = NDArray[np.float64]

# what is known of a frame before it is looked at
USABLE, SATURATED, EMPTY, EMPTY_SATURATED = range(4)
# places in the state's numbers
TIME, PENDING, RUNNING, COUNT = range(4)
_NEVER = -math.inf
_LEAST = -700.0  # log of a weight that underflows
_ODD = math.log(1e-2)  # log weight from which on a frame may have been an outlier
_SPARE = 5  # times as many hypotheses may be made by a frame as are kept after it
_UNLIKE = 1.0  # nats at which hypotheses are no longer merged for want of room
_SATURATED = int(Status.SATURATED)


class Room(NamedTuple):
    """Arrays that are overwritten, made once for many frames.

    Attributes
    ----------
    x, X, weight : ndarray
        The hypotheses after the frame.
    choices : ndarray, shape (capacity, CHOICE_COLUMNS)
        Modes that were found.
    values, columns, work, factors : ndarray
        As the kernels below want them.
    """

    x: Array
    X: Array
    weight: Array
    choices: Array
    values: Array
    columns: Array
    work: Array
    factors: Array


@compiled
def _log(weight: float) -> float:
    return math.log(weight) if weight > 0.0 else _LEAST


@compiled
def _pass_time(
    seconds: float, x: Array, X: Array, weight: Array, numbers: Array, rules: Rules, work: Array
) -> None:
    """Predict everything to the time of the next frame."""
    count = int(numbers[COUNT])
    chance = presence_over(seconds, rules.leave, rules.arrive)
    carry, decay, noise = motion_over(seconds, rules.rate_sd, rules.rate_time)
    root = math.sqrt(seconds)
    drift1, drift2 = rules.drift1 * root, rules.drift2 * root
    learns = X.shape[1] > 2
    born = weight[0] * chance.arrived + numbers[PENDING] * (1.0 - chance.left)
    empty = weight[0] * (1.0 - chance.arrived)
    for j in range(1, count + 1):
        left = weight[j] * chance.left
        empty += left
        if learns and left > 1e-9 * empty:
            merge(x, X, 0, j, left / empty, 2, work)
        born += weight[j] * chance.replaced
        weight[j] *= chance.stayed
        along = carry * x[j, 1]
        move(x, X, j, carry, decay, noise, drift1, drift2, work)
        if learns:
            x[j, ANCHOR] += certainty(x, X, j) * along
    weight[0] = empty + numbers[PENDING] * chance.left
    numbers[PENDING] = born
    if learns:
        move(x, X, 0, 0.0, 0.0, (0.0, 0.0, 0.0), drift1, drift2, work)


@compiled
def _copy(x_to: Array, X_to: Array, to: int, x: Array, X: Array, row: int) -> None:
    """Copy one hypothesis."""
    for i in range(x.shape[1]):
        x_to[to, i] = x[row, i]
    for i in range(X.shape[1]):
        for j in range(X.shape[2]):
            X_to[to, i, j] = X[row, i, j]


@compiled
def _weigh(
    first: float,
    second: float,
    gain: float,
    x: Array,
    X: Array,
    weight: Array,
    numbers: Array,
    curve: Curve,
    places: Places,
    rules: Rules,
    room: Room,
    full: bool,
) -> tuple[float, float]:
    """Weigh every hypothesis by a frame; the outlier's probability and the surprise."""
    count = int(numbers[COUNT])
    choices, columns, work, factors = room.choices, room.columns, room.work, room.factors
    values, scan, next_scan = room.values, places.scan, places.next_scan
    spread = X[0, X.shape[1] - 2 :]
    log_usual, log_odd = math.log1p(-rules.outlier), math.log(rules.outlier)
    found = 0
    for h in range(1, count + 1):
        prior = prior_of(x, X, h, gain, _log(weight[h]) + log_usual, curve)
        found = find_choices(
            choices, found, float(h), first, second, prior, spread, curve, scan, next_scan, values
        )
    density, surprise, expected1, expected2 = learn_empty(
        x, X, first, second, gain, curve, places.empty, columns, work, factors, False
    )
    strange = log_outlier(first, second, expected1, expected2, rules, curve)
    usual_empty = _log(weight[0]) + log_usual + density
    odd_empty = _log(weight[0]) + log_odd + strange
    log_born = _log(numbers[PENDING])
    odd_born = log_born + log_odd + strange
    best = max(usual_empty, odd_empty, odd_born)
    for j in range(found):
        best = max(best, choices[j, 0])
    # what is too light to be looked for is kept at an upper bound of its weight until it is not
    old = found
    bound = log_born + math.log(mass_bound(first, second, gain, X.shape[1], curve, places))
    pending = math.exp(min(bound - best, 0.0)) + math.exp(odd_born - best)
    if full or bound > best + rules.log_negligible:
        prior = born_prior(x, X, gain, log_born + log_usual, rules.rate_sd, curve)
        found = find_choices(
            choices, found, 0.0, first, second, prior, spread, curve, scan, next_scan, values
        )
        for j in range(old, found):
            best = max(best, choices[j, 0])
        pending = math.exp(odd_born - best)
    for h in range(1, count + 1):
        # a bound first: the density of a reading just as expected
        log_weight = _log(weight[h]) + log_odd
        if log_weight - math.log(rules.breadth) < best + _ODD:
            continue
        expected1, expected2 = expected_readings(x, h, gain, curve)
        odd = log_weight + log_outlier(first, second, expected1, expected2, rules, curve)
        if odd > best + _ODD and found < choices.shape[0]:
            choices[found, 0], choices[found, 5] = odd, -float(h)
            found += 1
            best = max(best, odd)

    empty, odd_mass = math.exp(usual_empty - best), math.exp(odd_empty - best)
    outlying = odd_mass + math.exp(odd_born - best)
    heaviest = empty
    if outlying > heaviest:
        heaviest, surprise = outlying, rules.most_surprise
    kept, total = 0, empty + odd_mass
    while kept < room.weight.size - 1:
        top = 0
        for j in range(1, found):
            if choices[j, 0] > choices[top, 0]:
                top = j
        if found == 0 or not choices[top, 0] > best + rules.log_negligible:
            break
        kept += 1
        mass = math.exp(choices[top, 0] - best)
        choices[top, 0] = _NEVER
        parent = int(choices[top, 5])
        _copy(room.x, room.X, kept, x, X, abs(parent))
        room.weight[kept] = mass
        total += mass
        own = rules.most_surprise
        if parent < 0:
            outlying += mass
        else:
            if parent == 0:
                prior = born_prior(x, X, gain, 0.0, rules.rate_sd, curve)
            else:
                prior = prior_of(x, X, parent, gain, 0.0, curve)
            own = learn(
                room.x,
                room.X,
                kept,
                choices,
                top,
                first,
                second,
                prior,
                curve,
                columns,
                work,
                factors,
            )
        if mass > heaviest:
            heaviest, surprise = mass, own
    for j in range(found):
        # objects too light to be followed one by one: only that there may be one is remembered
        if choices[j, 5] == 0.0 and choices[j, 0] > _NEVER:
            pending += math.exp(choices[j, 0] - best)
    total += pending
    if X.shape[1] > 2 and usual_empty > odd_empty:
        learn_empty(x, X, first, second, gain, curve, places.empty, columns, work, factors, True)
    weight[0] = (empty + odd_mass) / total
    numbers[PENDING] = pending / total
    kept = merge_equals(room.x, room.X, room.weight, kept, rules.same, work)
    same = rules.same
    while kept > x.shape[0] - 1 and same < _UNLIKE:
        same *= 3.0
        kept = merge_equals(room.x, room.X, room.weight, kept, same, work)
    while kept > x.shape[0] - 1:
        kept = drop_lightest(room.x, room.X, room.weight, kept)
    for j in range(1, kept + 1):
        _copy(x, X, j, room.x, room.X, j)
        weight[j] = room.weight[j] / total
    numbers[COUNT] = kept
    return outlying / total, surprise


@compiled
def run_filter(
    out: Array,
    rows: Array,
    times: Array,
    frames: Array,
    kinds: NDArray[np.uint8],
    x: Array,
    X: Array,
    weight: Array,
    numbers: Array,
    curve: Curve,
    places: Places,
    rules: Rules,
    full: bool,
) -> None:
    """Run the filter over frames.

    Parameters
    ----------
    out, rows : ndarray
        Filled, as `report` has it.
    times : ndarray, shape (frames,)
        Times [s], increasing, later than the state's.
    frames : ndarray, shape (frames, 3)
        Readings in units of the read noise, and the gain factor.
    kinds : ndarray of uint8, shape (frames,)
        `USABLE`, `SATURATED`, `EMPTY` (known to hold no object) or `EMPTY_SATURATED`.
    x, X, weight : ndarray, shape (rows, n), (rows, n, n + p), (rows,)
        State, changed in place: row 0 is the empty scene, the others are hypotheses.
    numbers : ndarray, shape (4,)
        Time of the last frame (nan: none yet), weight of an object of which nothing is known yet,
        running surprise, number of hypotheses.
    curve, places, rules : Curve, Places, Rules
        The model.
    full : bool
        Whether to look for new objects along the whole curve in every frame, also where none could
        weigh enough to be kept.
    """
    capacity, n, m = X.shape
    room = Room(
        np.zeros((_SPARE * capacity, x.shape[1])),
        np.zeros((_SPARE * capacity, n, m)),
        np.zeros(_SPARE * capacity),
        np.empty((2 * _SPARE * capacity, CHOICE_COLUMNS)),
        np.empty((places.scan.size + 3, 2)),
        np.zeros((2, m - n)),
        np.zeros((n, 4 * n + m + 4)),
        np.zeros((4, m)),
    )
    for i in range(times.size):
        if math.isfinite(numbers[TIME]):
            _pass_time(times[i] - numbers[TIME], x, X, weight, numbers, rules, room.work)
        numbers[TIME] = times[i]
        outlier, surprise = 0.0, math.nan
        if kinds[i] == USABLE:
            outlier, surprise = _weigh(
                frames[i, 0],
                frames[i, 1],
                frames[i, 2],
                x,
                X,
                weight,
                numbers,
                curve,
                places,
                rules,
                room,
                full,
            )
        elif kinds[i] != SATURATED:
            if kinds[i] == EMPTY:
                _, surprise, _, _ = learn_empty(
                    x,
                    X,
                    frames[i, 0],
                    frames[i, 1],
                    frames[i, 2],
                    curve,
                    places.empty,
                    room.columns,
                    room.work,
                    room.factors,
                    True,
                )
            weight[0], numbers[PENDING], numbers[COUNT] = 1.0, 0.0, 0.0
        if not math.isnan(surprise):
            own = min(surprise, rules.most_surprise) / curve.channels
            numbers[RUNNING] += (1.0 - rules.memory) * (own - numbers[RUNNING])
        report(out, rows, i, x, X, weight, int(numbers[COUNT]), rules.unique_above)
        out[i, OUTLIER], out[i, SURPRISE] = outlier, numbers[RUNNING]
        if kinds[i] == SATURATED or kinds[i] == EMPTY_SATURATED:
            out[i, STATUS] = _SATURATED
