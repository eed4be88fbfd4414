"""What a frame may make of the hypotheses: a list of modes with their masses."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = [
    "NEW",
    "NEW_UNREAD",
    "TrackCandidate",
    "TrackCandidates",
    "add_candidate",
    "candidates_for",
    "heaviest_of",
    "log_mass_of",
    "row_of",
    "take",
]

Array = NDArray[np.float64]

NEW = 0
"""Parent of a candidate that is an object that has just come."""
NEW_UNREAD = -1_000_000
"""Parent of one whose range is known, and whose readings have nothing to do with the scene."""


class TrackCandidate(NamedTuple):
    """One mode of a frame's density under one hypothesis."""

    log_mass: float  # log of what the density integrates to
    # of u = log r; a standard deviation of 0 was not integrated
    mean: float
    sd: float
    mode: float  # where the density is largest, log range
    # row of the hypothesis, `NEW`, or less than 0: the frame's readings are an outlier and leave
    # hypothesis ``-parent``, or `NEW_UNREAD`, as it was
    parent: int


class TrackCandidates(NamedTuple):
    """Room for candidates, an array for each attribute of `TrackCandidate`, shape (capacity,)."""

    log_mass: Array
    mean: Array
    sd: Array
    mode: Array
    parent: NDArray[np.int64]


@compiled
def candidates_for(capacity: int) -> TrackCandidates:
    """Return room for as many candidates."""
    return TrackCandidates(
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity),
        np.empty(capacity, dtype=np.int64),
    )


@compiled
def add_candidate(to: TrackCandidates, count: int, one: TrackCandidate) -> int:
    """Append a candidate, where there is no room in the place of the lightest; the new length."""
    place = count
    if count == to.log_mass.size:
        place = 0
        for j in range(count):
            if to.log_mass[j] < to.log_mass[place]:
                place = j
    to.log_mass[place], to.mean[place], to.sd[place] = one.log_mass, one.mean, one.sd
    to.mode[place], to.parent[place] = one.mode, one.parent
    return max(count, place + 1)


@compiled
def log_mass_of(of: TrackCandidates, first: int, last: int, least: float) -> float:
    """Return the greatest log mass from one place to another, or ``least`` where none is."""
    best = least
    for j in range(first, last):
        best = max(best, of.log_mass[j])
    return best


@compiled
def heaviest_of(of: TrackCandidates, first: int, last: int) -> int:
    """Return the place of the heaviest candidate from one place to before another."""
    top = first
    for j in range(first + 1, last):
        if of.log_mass[j] > of.log_mass[top]:
            top = j
    return top


@compiled
def row_of(parent: int) -> int:
    """Return the row of the hypothesis that a candidate comes from; the empty scene's if new."""
    return 0 if parent == NEW_UNREAD else abs(parent)


@compiled
def take(of: TrackCandidates, place: int) -> TrackCandidate:
    """Return a candidate, which then weighs nothing."""
    log_mass = of.log_mass[place]
    of.log_mass[place] = -math.inf
    return TrackCandidate(log_mass, of.mean[place], of.sd[place], of.mode[place], of.parent[place])
