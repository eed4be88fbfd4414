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
    NEW_UNREAD,
    TrackCandidate,
    TrackCandidates,
    candidates_for,
    heaviest_of,
    log_mass_of,
    row_of,
    take,
)
from inference.tracking.empty_scene import NEVER, Empty, learn_empty, weigh_empty
from inference.tracking.evenness import (
    counted_widths,
    even_out,
    hides,
    let_rest,
    level_at_rest,
    log_at_rest,
    log_total,
    take_width,
)
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import (
    COUNT,
    PENDING,
    Hypotheses,
    Scratch,
    copy,
    learns_crosstalk,
    log_of,
    scratch_for,
)
from inference.tracking.learning import learn
from inference.tracking.light_steps import may_step
from inference.tracking.merging import prune
from inference.tracking.modes import Scanned, find_candidates, scanned_for
from inference.tracking.motion import Rules
from inference.tracking.places import Places, mass_bound
from inference.tracking.prediction import born_prior, own_prior, prior_of
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.report import HYPOTHESIS_COLUMNS
from inference.tracking.resting import nothing_has_changed
from inference.tracking.stillness import crosstalk_is_held
from inference.tracking.too_faint import MOST_EMPTY, doubt_the_faint
from inference.tracking.turning import may_turn
from inference.tracking.unread import add_unread, learn_unread, odd_weight
from inference.tracking.without_object import carry_told
from simulator.compiled import compiled

__all__ = ["Model", "Room", "room_for", "weigh_frame", "weigh_known"]

Array = NDArray[np.float64]

_SPARE = 5  # times as many hypotheses may be made by a frame as are kept after it


class Model(NamedTuple):
    """What the filter knows of scene and sensor, and what it takes for granted."""

    table: ReadingsTable
    places: Places
    rules: Rules
    first: Hypotheses  # before any frame


class Room(NamedTuple):
    """Arrays that are overwritten, made once for many frames."""

    after: Hypotheses  # those after the frame
    candidates: TrackCandidates  # modes that were found
    scanned: Scanned  # where they were looked for
    scratch: Scratch  # for learning
    at_rest: Array  # log masses of hypotheses, were there no motion
    empty: Hypotheses  # what was known of the empty scene
    described: Array  # what is said of them


class Kept(NamedTuple):
    """What was kept of the candidates."""

    hypotheses: int  # how many
    empty: float  # mass of the empty scene
    total: float  # of it and all hypotheses
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
    empty = Hypotheses(np.zeros((1, of.x.shape[1])), np.zeros((1, n, m)), np.zeros(1), np.zeros(1))
    rest = np.zeros(capacity)
    described = np.zeros((capacity, HYPOTHESIS_COLUMNS))
    return Room(
        after, candidates, scanned_for(places.scan), scratch_for(of), rest, empty, described
    )


@compiled
def _of_followed(
    frame: TrackedFrame, seconds: float, of: Hypotheses, model: Model, room: Room, empty: Empty
) -> int:
    """List the modes of the frame under every hypothesis; their number."""
    log_usual = math.log1p(-model.rules.outlier)
    table, scan = model.table, model.places.scan
    candidates, followed = room.candidates, int(of.numbers[COUNT])
    learns, at_rest = learns_crosstalk(of), room.at_rest
    counted = counted_widths(of)
    found, log_before = 0, -math.inf
    for h in range(at_rest.size if learns else 0):
        at_rest[h] = -math.inf
    for h in range(1, followed + 1):
        old, log_weight = found, log_of(of.weight[h])
        if may_step(of, h, frame, empty.surprise, table, model.rules, room.scratch.work):
            log_weight += math.log(model.rules.outlier)
        known = frame.known_rate > 0.0
        prior = prior_of(of, h, frame.gain, log_weight + log_usual, table, known)
        found = find_candidates(candidates, found, h, frame, prior, table, scan, room.scanned)
        if learns and model.rules.rate_sd > 0.0 and found > old:
            mode = candidates.mode[heaviest_of(candidates, old, found)]
            step = may_turn(of, h, mode, prior, seconds, room.scratch.work)
            if step > 0.0:
                turned = log_weight + log_usual - math.log(step)
                prior = prior_of(of, h, frame.gain, turned, table, known)
                found = find_candidates(candidates, old, h, frame, prior, table, scan, room.scanned)
        hidden, smooth = learns and hides(of, h), followed > 1 and counted < 1.0
        if found == old or not (hidden or smooth):
            continue
        rest = log_at_rest(candidates, old, found, frame, prior, table)
        if hidden:
            at_rest[h] = rest
        if smooth:
            log_before = np.logaddexp(log_before, log_total(candidates, old, found))
            take_width(candidates, old, found, counted, rest)
    even_out(candidates, found, log_before)
    if learns and nothing_has_changed(of):
        level_at_rest(candidates, found, of, at_rest, log_usual)
    if learns and not frame.known_rate > 0.0:
        # a density is as high at best as that of the empty scene, whose readings these would be
        highest = empty.usual + 0.5 * empty.surprise - log_of(of.weight[0]) - log_usual
        let_rest(candidates, found, at_rest, highest, empty.usual)
    return found


@compiled
def _of_new(
    frame: TrackedFrame, of: Hypotheses, model: Model, room: Room, found: int, log_came: float
) -> int:
    """List the modes of an object that has just come; the new length of the list."""
    table, rules = model.table, model.rules
    prior = born_prior(of, log_came + math.log1p(-rules.outlier), rules.rate_sd, table)
    return find_candidates(
        room.candidates, found, NEW, frame, prior, table, model.places.scan, room.scanned
    )


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
        known = frame.known_rate > 0.0
        prior = own_prior(of, candidate.parent, frame.gain, 0.0, model.table, known)
    held = crosstalk_is_held(of)
    return learn(room.after, row, candidate, frame, prior, model.table, room.scratch, held)


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
    carry_told(after, of)  # whoever learns asks for it
    usual, odd = math.exp(empty.usual - best), math.exp(empty.odd - best)
    outlying = odd + math.exp(empty.odd_born - best)
    heaviest, surprise = usual, empty.surprise
    if outlying > heaviest:
        heaviest, surprise = outlying, rules.most_surprise
    count, total = 0, usual + odd
    while found > 0 and count < after.weight.size - 1:
        top = heaviest_of(candidates, 0, found)
        if not candidates.log_mass[top] > best + rules.log_negligible:
            break
        count += 1
        candidate = take(candidates, top)
        mass = math.exp(candidate.log_mass - best)
        copy(after, count, of, row_of(candidate.parent))
        after.weight[count] = mass
        total += mass
        own = rules.most_surprise
        if candidate.parent < 0:
            outlying += mass
            learn_unread(after, count, candidate, frame, rules.rate_sd, model.table, room.scratch)
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


@compiled
def _settle(
    of: Hypotheses,
    model: Model,
    room: Room,
    kept: Kept,
    pending: float,
    found: int,
    best: float,
) -> float:
    """Make what was kept the filter's state; the total mass."""
    candidates = room.candidates
    for j in range(found):
        # objects too light to be followed one by one: only that there may be one is remembered
        new = candidates.parent[j] == NEW or candidates.parent[j] == NEW_UNREAD
        if new and candidates.log_mass[j] > -math.inf:
            pending += math.exp(candidates.log_mass[j] - best)
    total = kept.total + pending
    of.weight[0] = kept.empty / total
    of.numbers[PENDING] = pending / total
    # an object that has just come may come in more, and they stay until frames tell them apart
    followed = int(of.numbers[COUNT])
    most = max(model.rules.hypotheses, followed) if followed > 0 else of.x.shape[0] - 1
    count = prune(room.after, kept.hypotheses, most, model.rules.same, room.scratch.work)
    _take_over(of, room.after, count, total)
    return total


@compiled
def _came(frame: TrackedFrame, of: Hypotheses, model: Model, best: float) -> float:
    """Return the log probability that an object is where none was followed: come, or jumped.

    Of jumps only where the frame may be an outlier, as likely as that; not where crosstalk is
    learnt, since what is known of it is the hypothesis's own.
    """
    rules = model.rules
    jumped = 0.0
    if rules.rate_sd > 0.0 and not learns_crosstalk(of):
        jumped = rules.outlier * odd_weight(best, frame, of, model.table, rules)
    return log_of(of.numbers[PENDING] + jumped)


@borrowed
@compiled
def weigh_frame(
    frame: TrackedFrame, seconds: float, of: Hypotheses, model: Model, room: Room, full: bool
) -> tuple[float, float]:
    """Weigh every hypothesis by a frame.

    Parameters
    ----------
    frame : TrackedFrame
        The frame.
    seconds : float
        Since the frame before [s]; 0 where there is none.
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
    empty = weigh_empty(frame, of, model.table, model.places.empty, rules, room.scratch)
    found = _of_followed(frame, seconds, of, model, room, empty)
    best = max(empty.usual, empty.odd, empty.odd_born)
    best = log_mass_of(candidates, 0, found, best)
    # what is too light to be looked for is kept at an upper bound of its weight until it is not
    bound = mass_bound(frame, of.X.shape[1], model.table, model.places)
    log_came = _came(frame, of, model, best)
    log_bound = log_came + math.log(bound)
    pending = math.exp(min(log_bound - best, 0.0)) + math.exp(empty.odd_born - best)
    if full or log_bound > best + rules.log_negligible:
        old = found
        found = _of_new(frame, of, model, room, found, log_came)
        best = log_mass_of(candidates, old, found, best)
        pending = math.exp(empty.odd_born - best)
    before = best
    found, best = add_unread(
        candidates, found, best, frame, of, model.table, rules, empty.strange, False
    )
    pending *= math.exp(before - best)
    kept = _keep(frame, of, model, room, found, best, empty)
    if learns_crosstalk(of) and empty.usual > empty.odd:
        learn_empty(of, frame, model.table, model.places.empty, room.scratch)
    total = _settle(of, model, room, kept, pending, found, best)
    if of.weight[0] < MOST_EMPTY:
        doubt_the_faint(frame, of, model.table, model.places, empty.surprise)
    return kept.outlying / total, kept.surprise


@borrowed
@compiled
def weigh_known(frame: TrackedFrame, of: Hypotheses, model: Model, room: Room) -> None:
    """Weigh every hypothesis by the known range of a frame whose readings are saturated.

    Parameters are those of `weigh_frame`.
    """
    empty = Empty(NEVER, NEVER, NEVER, 0.0, 0.0)
    found, best = add_unread(
        room.candidates, 0, NEVER, frame, of, model.table, model.rules, 0.0, True
    )
    kept = _keep(frame, of, model, room, found, best, empty)
    _settle(of, model, room, kept, 0.0, found, best)
