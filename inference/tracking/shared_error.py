"""What u and crosstalk err in common, kept apart from what u errs alone.

Crosstalk that is not known moves range and crosstalk together, along the line on which the readings
stay as they are. Seen from one frame after the other, that line is tangential to the curve at
another u each time, by the noise: an extended Kalman filter takes the turns between the tangents
for knowledge and soon believes that it knows both, as in simultaneous localisation and mapping
(Julier and Uhlmann 2001; Huang, Mourikis and Roumeliotis 2010). Here the error of u is divided into
what follows the crosstalk's error and the rest. Along the rest the curve is what it is. Along the
common part it is straight, its tangent taken at an anchor. What an update corrects, and what a rate
moves that may be noise, turns the tangent with the errors of the readings kept: no knowledge comes
from it. What is motion for certain turns it with the errors of the crosstalk kept, and that is how
motion tells range and crosstalk apart: by the direction of the tangent alone where a frame shows
that motion, and by its length too where the rate foretold it. It is certain where the rate is
known, and where a frame shows it well beyond what the frame itself may err: of an object far slower
than it may be the rate is never known, and its motion taken for corrections would turn crosstalk
that stays.

docs/model.md, learnt-steps, has what a step that a frame shows tells.

Errors of readings are kept as far as frames tell them. What nuisance parameters hide, far beyond
what noise and crosstalk could be, no frame has told, and crosstalk that took it up would leave what
is known of it. For the same reason crosstalk that is known to a frame's noise takes up no turn
of a tangent where the light is open by more: it gains next to nothing from turns between tangents,
and 15 frames stated empty were unlearnt, by up to hundreds of noises. What is known of it without
any object takes up none, whatever the light (`inference.tracking.without_object`).
"""

import math
from typing import NamedTuple

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import (
    ANCHOR,
    CROSSTALK1,
    CROSSTALK2,
    TOLD,
    Hypotheses,
    U,
    V,
    unknown_crosstalk,
    variance_of,
)
from inference.tracking.readings_table import (
    ReadingsTable,
    mean_at,
    nuisance_count,
    nuisance_root,
)
from inference.tracking.roots import Root, add_factor, add_root, solve
from inference.tracking.without_object import open_part
from simulator.compiled import compiled

__all__ = [
    "NOT_SHARED",
    "Shared",
    "bring_anchor",
    "certainty",
    "follow",
    "known_part",
    "shared_of",
    "shared_part",
    "straighten",
]

_MOST = 0.5  # of the common part that a change of tangent may take up
_CERTAIN = 9.0  # variances of its error at which half of a motion counts as certain
_LONGEST = 3.0  # times the common part may grow in a frame: where light drowns, tangents vanish
_UNFELT = 1e-2  # variance of the noise: along what the crosstalk errs by less, nothing follows it
_SINGULAR = 1e-14  # of a determinant against the product of its diagonal


class Told(NamedTuple):
    """The share of a change of the readings that frames tell, beside nuisance parameters.

    By its elements, of the matrix V (V + N)^-1: V is the covariance by noise and crosstalk, N that
    by nuisance parameters.
    """

    by11: float
    by12: float
    by21: float
    by22: float


class Shared(NamedTuple):
    """What u errs with the crosstalk, and what was known before an update."""

    # regression of u on the two crosstalk readings
    back1: float
    back2: float
    # derivatives of the readings along u at the anchor, less those that are taken
    turn1: float
    turn2: float
    # means before the update
    crosstalk1: float
    crosstalk2: float
    told: Told
    turns: float  # how much of a change of tangent the crosstalk's errors take up


_ALL = Told(1.0, 0.0, 0.0, 1.0)
NOT_SHARED = Shared(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, _ALL, 1.0)


@compiled
def known_part(of: Hypotheses, row: int) -> float:
    """Return how little crosstalk can take up of what a frame's readings err, from 0 to 1.

    `inference.tracking.without_object` has the rule.
    """
    return 1.0 - open_part(unknown_crosstalk(of, row))


@compiled
def _told_of(
    of: Hypotheses, row: int, noise: Root, u: float, gain: float, table: ReadingsTable
) -> Told:
    """Return the share of noise and crosstalk in what a hypothesis expects of the readings."""
    if nuisance_count(table) == 0:
        return _ALL
    X = of.X
    own = noise
    for j in range(X.shape[1]):
        own = add_factor(own, X[row, CROSSTALK1, j], X[row, CROSSTALK2, j])
    both = add_root(own, nuisance_root(u, gain, table))
    v11, v12 = own.r11 * own.r11, own.r11 * own.r21
    v22 = own.r21 * own.r21 + own.r22 * own.r22
    by11, by12 = solve(both, v11, v12)
    by21, by22 = solve(both, v12, v22)
    return Told(by11, by12, by21, by22)


@compiled
def _kept(told: Told, first: float, second: float) -> tuple[float, float]:
    """Return the part of a change of the readings that frames tell."""
    return (
        told.by11 * first + told.by12 * second,
        told.by21 * first + told.by22 * second,
    )


@compiled
def shared_part(of: Hypotheses, row: int) -> tuple[float, float, float]:
    """Return how u follows the crosstalk, and the share of its variance that does.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; what nuisance parameters do to it plays no part.

    Returns
    -------
    (float, float, float)
        Regression of u on the two crosstalk readings, and the share of its variance.
    """
    X = of.X
    uu, u1, u2, k11, k12, k22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(X.shape[1]):
        u, first, second = X[row, U, j], X[row, CROSSTALK1, j], X[row, CROSSTALK2, j]
        uu += u * u
        u1 += u * first
        u2 += u * second
        k11 += first * first
        k12 += first * second
        k22 += second * second
    k11, k22 = k11 + _UNFELT, k22 + _UNFELT
    determinant = k11 * k22 - k12 * k12
    if not determinant > _SINGULAR * k11 * k22:
        return 0.0, 0.0, 0.0
    back1 = (k22 * u1 - k12 * u2) / determinant
    back2 = (k11 * u2 - k12 * u1) / determinant
    share = (back1 * u1 + back2 * u2) / uu if uu > 0.0 else 0.0
    return back1, back2, min(max(share, 0.0), 1.0)


@compiled
def shared_of(of: Hypotheses, row: int) -> Shared:
    """Return what a hypothesis errs in common before an update along the tangent at its anchor."""
    back1, back2, _ = shared_part(of, row)
    x, turns = of.x, open_part(of.numbers[TOLD])
    return Shared(back1, back2, 0.0, 0.0, x[row, CROSSTALK1], x[row, CROSSTALK2], _ALL, turns)


@compiled
def certainty(of: Hypotheses, row: int) -> float:
    """Return how much of a rate is motion rather than noise, from 0 to 1."""
    square = of.x[row, V] * of.x[row, V]
    return square / (square + variance_of(of, row, V)) if square > 0.0 else 0.0


@compiled
def bring_anchor(
    of: Hypotheses,
    row: int,
    at: float,
    own: float,
    told: float,
    unsure: float,
    table: ReadingsTable,
) -> None:
    """Bring the anchor to where a frame shows that the object has moved, as far as that is certain.

    How far a step goes is known by the light that the crosstalk leaves, and by nothing else: with
    more light it is shorter. So the common part of u grows as the tangent becomes shorter, and what
    tells range and crosstalk apart is that the tangent turns. By its length the law of the motion
    would tell the crosstalk, in every frame that a step is unlikely, and to the same side.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis as predicted; its anchor and its root are changed in place.
    at : float
        log r at the frame's mode, less what that corrects of the common part.
    own : float
        Variance of what u errs by itself.
    told : float
        What the frame tells of log r: one over its variance.
    unsure : float
        Relative variance of the derivatives by which the readings tell it.
    table : ReadingsTable
        Mean readings.
    """
    x, X = of.x, of.X
    error = own / (1.0 + own * told)
    moved = at - x[row, ANCHOR]
    square = moved * moved
    if not square > 0.0:
        return
    _, _, before1, before2 = mean_at(x[row, ANCHOR], table)
    x[row, ANCHOR] += square / (square + _CERTAIN * (error + unsure * square)) * moved
    _, _, after1, after2 = mean_at(x[row, ANCHOR], table)
    before, after = math.hypot(before1, before2), math.hypot(after1, after2)
    longer = min(before / after, _LONGEST) - 1.0 if after > 0.0 else 0.0
    back1, back2, _ = shared_part(of, row)
    for j in range(X.shape[1]):
        X[row, U, j] += longer * (back1 * X[row, CROSSTALK1, j] + back2 * X[row, CROSSTALK2, j])


@borrowed
@compiled
def straighten(
    of: Hypotheses,
    row: int,
    gain: float,
    tangent: tuple[float, float, float],
    noise: Root,
    table: ReadingsTable,
) -> Shared:
    """Let the crosstalk's errors take up what the common part of u does along another tangent.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis; its root is changed in place.
    gain : float
        The frame's factor on the sensor's gain.
    tangent : (float, float, float)
        log r, and the derivatives of the frame's readings along it that will be taken.
    noise : Root
        Of the covariance of the frame's own errors.
    table : ReadingsTable
        Mean readings.
    """
    x, X = of.x, of.X
    at, slope1, slope2 = tangent
    told = _told_of(of, row, noise, at, gain, table)
    back1, back2, _ = shared_part(of, row)
    _, _, s1, s2 = mean_at(x[row, ANCHOR], table)
    # crosstalk that is known stays what it is, whatever the light: a turn of what the light hides
    # would open it, and teach it what no frame has told
    hidden = nuisance_root(at, gain, table)
    square = hidden.r11 * hidden.r11 + hidden.r21 * hidden.r21 + hidden.r22 * hidden.r22
    turns = 1.0 - known_part(of, row) * (1.0 - 1.0 / (1.0 + square))
    # nor does what is known of it without any object turn with what that object does
    turns *= open_part(of.numbers[TOLD])
    turn1, turn2 = _kept(told, turns * (gain * s1 - slope1), turns * (gain * s2 - slope2))
    # held to what can be undone
    along = back1 * turn1 + back2 * turn2
    held = min(1.0, _MOST / abs(along)) if along != 0.0 else 1.0
    turn1, turn2 = held * turn1, held * turn2
    for j in range(X.shape[1]):
        common = back1 * X[row, CROSSTALK1, j] + back2 * X[row, CROSSTALK2, j]
        X[row, CROSSTALK1, j] += turn1 * common
        X[row, CROSSTALK2, j] += turn2 * common
    return Shared(back1, back2, turn1, turn2, x[row, CROSSTALK1], x[row, CROSSTALK2], told, turns)


@borrowed
@compiled
def follow(of: Hypotheses, row: int, shared: Shared, gain: float, table: ReadingsTable) -> None:
    """Undo `straighten` after an update, and bring the anchor to where the object is now.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis, updated in these coordinates; changed in place.
    shared : Shared
        From `straighten`, or `shared_of`.
    gain, table
        As for `straighten`.
    """
    x, X = of.x, of.X
    back1, back2, turn1, turn2 = shared.back1, shared.back2, shared.turn1, shared.turn2
    scale = 1.0 + back1 * turn1 + back2 * turn2
    change1 = x[row, CROSSTALK1] - shared.crosstalk1
    change2 = x[row, CROSSTALK2] - shared.crosstalk2
    common = (back1 * change1 + back2 * change2) / scale
    # the curve bends away from its tangent: what the readings are expected to be stays
    here1, here2, _, _ = mean_at(x[row, U] - common, table)
    there1, there2, _, _ = mean_at(x[row, U], table)
    _, _, s1, s2 = mean_at(x[row, ANCHOR], table)
    size = gain * shared.turns
    away1, away2 = size * (here1 + s1 * common - there1), size * (here2 + s2 * common - there2)
    away1, away2 = _kept(shared.told, away1, away2)
    x[row, CROSSTALK1] += away1 - turn1 * common
    x[row, CROSSTALK2] += away2 - turn2 * common
    # what an update corrects is no motion: the readings' errors stay what they are
    _, _, e1, e2 = mean_at(x[row, U], table)
    bend1, bend2 = _kept(shared.told, size * (s1 - e1), size * (s2 - e2))
    bend1, bend2 = bend1 - turn1, bend2 - turn2
    x[row, ANCHOR] = x[row, U]
    for j in range(X.shape[1]):
        follows = (back1 * X[row, CROSSTALK1, j] + back2 * X[row, CROSSTALK2, j]) / scale
        X[row, CROSSTALK1, j] += bend1 * follows
        X[row, CROSSTALK2, j] += bend2 * follows
