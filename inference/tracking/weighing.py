"""Every hypothesis weighed by one frame: candidates, the heaviest of them kept and taught, pruned.

Log masses are of what explains the frame; ``best`` is the greatest of them, and masses that are
not logarithms are in units of it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.candidates import (
    NEW,
    TrackCandidate,
    TrackCandidates,
    add_candidate,
    candidates_for,
    heaviest_of,
    log_mass_of,
    take,
)
from inference.tracking.empty_scene import expect_empty, learn_empty
from inference.tracking.evenness import counted_widths, even_out, log_total, take_width
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    COUNT,
    PENDING,
    ROUGHNESS,
    Hypotheses,
    Scratch,
    copy,
    learns_crosstalk,
    scratch_for,
)
from inference.tracking.learning import learn
from inference.tracking.merging import prune
from inference.tracking.modes import Scanned, find_candidates, scanned_for
from inference.tracking.motion import Rules
from inference.tracking.outliers import expected_readings, log_outlier
from inference.tracking.places import Places, mass_bound
from inference.tracking.prediction import born_prior, prior_of
from inference.tracking.readings_table import ReadingsTable
from simulator.compiled import compiled

__all__ = ["Model", "Room", "room_for", "weigh_frame"]

Array = NDArray[np.float64]

_LEAST = -700.0  # log of a weight that underflows
_ODD = math.log(1e-2)  # log weight from which on a frame may have been an outlier
_SPARE = 5  # times as many hypotheses may be made by a frame as are kept after it


class Model(NamedTuple):
    """What the filter knows of scene and sensor, and what it takes for granted."""

    table: ReadingsTable
    places: Places
    rules: Rules


class Room(NamedTuple):
    """Arrays that are overwritten, made once for many frames."""

    after: Hypotheses  # those after the frame
    candidates: TrackCandidates  # modes that were found
    scanned: Scanned  # where they were looked for
    scratch: Scratch  # for learning


class Empty(NamedTuple):
    """What the empty scene says of a frame."""

    # log masses of no object: with readings as expected, and with an outlier
    usual: float
    odd: float
    odd_born: float  # log mass of an object that has come and an outlier
    surprise: float  # normalised innovation squared


class Kept(NamedTuple):
    """What was kept of the candidates."""

    hypotheses: int  # how many
    # mass of the empty scene, and of it and all hypotheses
    empty: float
    total: float
    outlying: float  # mass of outliers
    surprise: float  # normalised innovation squared under the heaviest explanation


@compiled
def room_for(of: Hypotheses, places: Places) -> Room:
    """Return room for the frames of a tracker."""
    capacity, n, m = of.X.shape
    after = Hypotheses(
        np.zeros((_SPARE * capacity, of.x.shape[1])),
        np.zeros((_SPARE * capacity, n, m)),
        np.zeros(_SPARE * capacity),
        np.zeros(of.numbers.size),
    )
    candidates = candidates_for(2 * _SPARE * capacity)
    return Room(after, candidates, scanned_for(places.scan), scratch_for(of))


@compiled
def _log(weight: float) -> float:
    return math.log(weight) if weight > 0.0 else _LEAST


@compiled
def _of_followed(frame: TrackedFrame, of: Hypotheses, model: Model, room: Room) -> int:
    """List the modes of the frame under every hypothesis; their number."""
    log_usual = math.log1p(-model.rules.outlier)
    table, scan = model.table, model.places.scan
    candidates, followed = room.candidates, int(of.numbers[COUNT])
    counted = counted_widths(of.numbers[ROUGHNESS])
    found, log_before = 0, -math.inf
    for h in range(1, followed + 1):
        old, log_weight = found, _log(of.weight[h])
        prior = prior_of(of, h, frame.gain, log_weight + log_usual, table)
        found = find_candidates(candidates, found, h, frame, prior, table, scan, room.scanned)
        if followed > 1 and counted < 1.0 and found > old:
            log_before = np.logaddexp(log_before, log_total(candidates, old, found))
            take_width(candidates, old, found, counted, frame, prior, table)
    even_out(candidates, found, log_before)
    return found


@compiled
def _of_empty(frame: TrackedFrame, of: Hypotheses, model: Model, room: Room) -> Empty:
    """Weigh the empty scene, and an object that has come and is not seen."""
    rules = model.rules
    log_usual, log_odd = math.log1p(-rules.outlier), math.log(rules.outlier)
    expected = expect_empty(of, frame, model.table, model.places.empty, room.scratch.nuisance)
    strange = log_outlier(frame, expected.mean1, expected.mean2, model.table, rules)
    log_empty = _log(of.weight[0])
    return Empty(
        log_empty + log_usual + expected.log_density,
        log_empty + log_odd + strange,
        _log(of.numbers[PENDING]) + log_odd + strange,
        expected.surprise,
    )


@compiled
def _of_new(frame: TrackedFrame, of: Hypotheses, model: Model, room: Room, found: int) -> int:
    """List the modes of an object that has just come; the new length of the list."""
    table, rules = model.table, model.rules
    log_weight = _log(of.numbers[PENDING]) + math.log1p(-rules.outlier)
    prior = born_prior(of, log_weight, rules.rate_sd, table)
    return find_candidates(
        room.candidates, found, NEW, frame, prior, table, model.places.scan, room.scanned
    )


@compiled
def _of_outliers(
    frame: TrackedFrame, of: Hypotheses, model: Model, room: Room, found: int, best: float
) -> tuple[int, float]:
    """List the hypotheses that stay as they were, the frame being an outlier; length and best."""
    candidates, rules = room.candidates, model.rules
    log_odd = math.log(rules.outlier)
    for h in range(1, int(of.numbers[COUNT]) + 1):
        # a bound first: the density of a reading just as expected
        log_weight = _log(of.weight[h]) + log_odd
        if log_weight - math.log(rules.breadth) < best + _ODD:
            continue
        mean1, mean2 = expected_readings(of, h, frame.gain, model.table)
        odd = log_weight + log_outlier(frame, mean1, mean2, model.table, rules)
        if odd > best + _ODD and found < candidates.log_mass.size:
            found = add_candidate(candidates, found, TrackCandidate(odd, 0.0, 0.0, 0.0, -h))
            best = max(best, odd)
    return found, best


@compiled
def _learnt(
    row: int,
    candidate: TrackCandidate,
    frame: TrackedFrame,
    of: Hypotheses,
    model: Model,
    room: Room,
) -> float:
    """Teach a row of the hypotheses after the frame what its candidate says; its surprise."""
    if candidate.parent == NEW:
        prior = born_prior(of, 0.0, model.rules.rate_sd, model.table)
    else:
        prior = prior_of(of, candidate.parent, frame.gain, 0.0, model.table)
    return learn(room.after, row, candidate, frame, prior, model.table, room.scratch)


@compiled
def _keep(
    frame: TrackedFrame,
    of: Hypotheses,
    model: Model,
    room: Room,
    found: int,
    best: float,
    empty: Empty,
) -> Kept:
    """Take over the heaviest candidates, taught by the frame, until the rest is negligible."""
    rules, after, candidates = model.rules, room.after, room.candidates
    usual, odd = math.exp(empty.usual - best), math.exp(empty.odd - best)
    outlying = odd + math.exp(empty.odd_born - best)
    heaviest, surprise = usual, empty.surprise
    if outlying > heaviest:
        heaviest, surprise = outlying, rules.most_surprise
    count, total = 0, usual + odd
    while found > 0 and count < after.weight.size - 1:
        top = heaviest_of(candidates, found)
        if not candidates.log_mass[top] > best + rules.log_negligible:
            break
        count += 1
        candidate = take(candidates, top)
        mass = math.exp(candidate.log_mass - best)
        copy(after, count, of, abs(candidate.parent))
        after.weight[count] = mass
        total += mass
        own = rules.most_surprise
        if candidate.parent < 0:
            outlying += mass
        else:
            own = _learnt(count, candidate, frame, of, model, room)
        if mass > heaviest:
            heaviest, surprise = mass, own
    return Kept(count, usual + odd, total, outlying, surprise)


@compiled
def _take_over(of: Hypotheses, after: Hypotheses, count: int, total: float) -> None:
    """Make the hypotheses after the frame those of the filter, their weights normalised."""
    for j in range(1, count + 1):
        copy(of, j, after, j)
        of.weight[j] = after.weight[j] / total
    of.numbers[COUNT] = count


@borrowed
@compiled
def weigh_frame(
    frame: TrackedFrame, of: Hypotheses, model: Model, room: Room, full: bool
) -> tuple[float, float]:
    """Weigh every hypothesis by a frame.

    Parameters
    ----------
    frame : TrackedFrame
        The frame.
    of : Hypotheses
        As predicted; changed in place.
    model : Model
        Scene, sensor and rules.
    room : Room
        Overwritten.
    full : bool
        Whether to look for new objects also where none could weigh enough to be kept.

    Returns
    -------
    (float, float)
        Probability that the frame is an outlier, and its surprise: the normalised innovation
        squared under the heaviest explanation.
    """
    rules, candidates = model.rules, room.candidates
    found = _of_followed(frame, of, model, room)
    empty = _of_empty(frame, of, model, room)
    best = max(empty.usual, empty.odd, empty.odd_born)
    best = log_mass_of(candidates, 0, found, best)
    # what is too light to be looked for is kept at an upper bound of its weight until it is not
    bound = mass_bound(frame, of.X.shape[1], model.table, model.places)
    log_bound = _log(of.numbers[PENDING]) + math.log(bound)
    pending = math.exp(min(log_bound - best, 0.0)) + math.exp(empty.odd_born - best)
    if full or log_bound > best + rules.log_negligible:
        old = found
        found = _of_new(frame, of, model, room, found)
        best = log_mass_of(candidates, old, found, best)
        pending = math.exp(empty.odd_born - best)
    before = best
    found, best = _of_outliers(frame, of, model, room, found, best)
    pending *= math.exp(before - best)
    kept = _keep(frame, of, model, room, found, best, empty)
    for j in range(found):
        # objects too light to be followed one by one: only that there may be one is remembered
        if candidates.parent[j] == NEW and candidates.log_mass[j] > -math.inf:
            pending += math.exp(candidates.log_mass[j] - best)
    total = kept.total + pending
    if learns_crosstalk(of) and empty.usual > empty.odd:
        learn_empty(of, frame, model.table, model.places.empty, room.scratch)
    of.weight[0] = kept.empty / total
    of.numbers[PENDING] = pending / total
    most = of.x.shape[0] - 1
    count = prune(room.after, kept.hypotheses, most, rules.same, room.scratch.work)
    _take_over(of, room.after, count, total)
    return kept.outlying / total, kept.surprise
