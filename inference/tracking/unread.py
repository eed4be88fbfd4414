"""Explanations of a frame that its readings take no part in: outliers, and saturated frames.

Where the frame's range is known beside its readings, that is learnt all the same.
"""

import math

from inference.tracking.borrowed import borrowed
from inference.tracking.candidates import (
    NEW_UNREAD,
    TrackCandidate,
    TrackCandidates,
    add_candidate,
)
from inference.tracking.frame_density import TrackedFrame
from inference.tracking.hypotheses import COUNT, PENDING, Hypotheses, Scratch, log_of
from inference.tracking.known_range import known_of_hypothesis, known_of_new, take_known
from inference.tracking.learning import begin
from inference.tracking.motion import Rules
from inference.tracking.outliers import expected_readings, log_outlier
from inference.tracking.readings_table import ReadingsTable
from simulator.compiled import compiled

__all__ = ["add_unread", "learn_unread", "odd_weight"]

_ODD = math.log(1e-2)  # log weight from which on a frame may have been an outlier


@compiled
def _add_new(
    to: TrackCandidates,
    found: int,
    log_weight: float,
    best: float,
    frame: TrackedFrame,
    table: ReadingsTable,
) -> tuple[int, float]:
    """List an object that has come, of whose range only what is known is taken."""
    log_mass, u = known_of_new(frame, table)
    log_mass += log_weight
    return (
        add_candidate(to, found, TrackCandidate(log_mass, 0.0, 0.0, u, NEW_UNREAD)),
        max(best, log_mass),
    )


@borrowed
@compiled
def add_unread(
    to: TrackCandidates,
    found: int,
    best: float,
    frame: TrackedFrame,
    of: Hypotheses,
    table: ReadingsTable,
    rules: Rules,
    empty: float,
    saturated: bool,
) -> tuple[int, float]:
    """List the hypotheses that readings leave as they were.

    Parameters
    ----------
    to, found : TrackCandidates, int
        The list and its length.
    best : float
        Greatest log mass in it.
    frame : TrackedFrame
        The frame.
    of : Hypotheses
        As predicted.
    table, rules : ReadingsTable, Rules
        Scene, sensor and rules.
    empty : float
        Log density of the readings as an outlier of the empty scene.
    saturated : bool
        Whether the readings are no outlier: they say nothing.

    Returns
    -------
    (int, float)
        The new length and the greatest log mass.
    """
    log_odd = 0.0 if saturated else math.log(rules.outlier)
    for h in range(1, int(of.numbers[COUNT]) + 1):
        # a bound first: the density of a reading just as expected, spread by noise alone
        log_mass, u = log_of(of.weight[h]) + log_odd, 0.0
        most = log_mass if saturated else log_mass - table.channels * math.log(rules.breadth)
        if most < best + _ODD:
            continue
        if not saturated:
            expected = expected_readings(of, h, frame.gain, table)
            log_mass += log_outlier(frame, expected, table, rules)
        if frame.known_rate > 0.0:
            beside, u = known_of_hypothesis(of, h, frame)
            log_mass += beside
        if log_mass > best + _ODD and found < to.log_mass.size:
            found = add_candidate(to, found, TrackCandidate(log_mass, 0.0, 0.0, u, -h))
            best = max(best, log_mass)
    if frame.known_rate > 0.0:
        log_weight = log_of(of.numbers[PENDING]) + log_odd + (0.0 if saturated else empty)
        found, best = _add_new(to, found, log_weight, best, frame, table)
    return found, best


@borrowed
@compiled
def odd_weight(
    best: float, frame: TrackedFrame, of: Hypotheses, table: ReadingsTable, rules: Rules
) -> float:
    """Return the weight of the hypotheses of which a frame may be an outlier.

    Parameters
    ----------
    best : float
        Greatest log mass of what explains the frame otherwise.
    frame, of, table, rules
        As for `add_unread`.
    """
    weight = 0.0
    for h in range(1, int(of.numbers[COUNT]) + 1):
        log_mass = log_of(of.weight[h]) + math.log(rules.outlier)
        if log_mass - table.channels * math.log(rules.breadth) < best + _ODD:
            continue
        expected = expected_readings(of, h, frame.gain, table)
        if log_mass + log_outlier(frame, expected, table, rules) > best + _ODD:
            weight += of.weight[h]
    return weight


@borrowed
@compiled
def learn_unread(
    of: Hypotheses,
    row: int,
    candidate: TrackCandidate,
    frame: TrackedFrame,
    rate_sd: float,
    table: ReadingsTable,
    scratch: Scratch,
) -> None:
    """Teach a hypothesis what is known of the range of a frame whose readings say nothing."""
    if frame.known_rate > 0.0:
        new = candidate.parent == NEW_UNREAD
        if new:
            begin(of, row, candidate.mode, rate_sd)
        take_known(of, row, candidate.mode, new, frame, table, scratch)
