"""One hypothesis and one frame: what it becomes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.candidates import TrackCandidate
from inference.tracking.frame_density import Prior, TrackedFrame, bend_at, spread_at, told_at
from inference.tracking.hypotheses import (
    ANCHOR,
    CROSSTALK1,
    WITHOUT_CROSSTALK,
    Hypotheses,
    Scratch,
    U,
    V,
    learns_crosstalk,
    variance_of,
)
from inference.tracking.known_range import take_known
from inference.tracking.light import noise_at_light
from inference.tracking.mode_refinement import bends
from inference.tracking.prediction import own_prior
from inference.tracking.readings_table import (
    FIRST,
    SECOND,
    ReadingsTable,
    cell_of,
    mean_at,
    nuisance_at,
    object_at,
)
from inference.tracking.roots import UNIT, Root, add_root, solve
from inference.tracking.second_order import add_products, slope_variance
from inference.tracking.shared_error import NOT_SHARED, bring_anchor, follow, straighten
from inference.tracking.square_root import Linear, update
from simulator.compiled import compiled

__all__ = ["begin", "learn"]

Array = NDArray[np.float64]

_BROAD = 10.0  # standard deviation of log r before the first frame: vague, but no more


class Tangent(NamedTuple):
    """The curve of readings at one mode."""

    u: float  # the mode, log range
    at: float  # where the curve is taken, log range
    # mean readings without crosstalk, and their derivatives along u
    value1: float
    value2: float
    slope1: float
    slope2: float


@compiled
def begin(of: Hypotheses, row: int, u: float, rate_sd: float) -> None:
    """Begin a hypothesis: anywhere near u, so vaguely that the frame alone speaks."""
    x, X = of.x, of.X
    x[row, U], x[row, V] = u, 0.0
    if learns_crosstalk(of):
        x[row, ANCHOR] = u
    for j in range(X.shape[-1]):
        X[row, U, j], X[row, V, j] = 0.0, 0.0
    X[row, U, U], X[row, V, V] = _BROAD, rate_sd


@compiled
def _of_derivatives(
    of: Hypotheses, row: int, tangent: Tangent, frame: TrackedFrame, prior: Prior
) -> Linear:
    """Linearise derivatives in time at a mode, and at the rate that the frame says there."""
    x, t, expected = of.x, tangent, prior.rate
    away = 0.0 if prior.position.born else t.u - prior.position.centre
    mean = expected.mean + expected.slope * away
    square = expected.sd * expected.sd
    along = t.value1 * (frame.first - t.value1 * mean) + t.value2 * (frame.second - t.value2 * mean)
    size = t.value1 * t.value1 + t.value2 * t.value2
    rate = mean + square * along / (1.0 + square * size)
    by_u1, by_u2 = t.slope1 * rate, t.slope2 * rate
    e1 = frame.first - t.value1 * x[row, V] - by_u1 * (x[row, U] - t.u)
    e2 = frame.second - t.value2 * x[row, V] - by_u2 * (x[row, U] - t.u)
    return Linear(e1, e2, by_u1, by_u2, t.value1, t.value2, UNIT)


@borrowed
@compiled
def _noise_of(
    of: Hypotheses,
    row: int,
    tangent: Tangent,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
) -> Root:
    """Return the root of the covariance of a frame's own errors at a mode."""
    t, noise, gain, added = tangent, UNIT, frame.gain, prior.added
    if not table.noise.plain:
        away = 0.0 if prior.position.born else t.u - prior.position.centre
        m1 = t.value1 + added.offset1 + added.slope1 * away
        m2 = t.value2 + added.offset2 + added.slope2 * away
        o1, o2 = object_at(t.u, table)
        residual = frame.first - m1, frame.second - m2
        noise = noise_at_light((m1, m2), (gain * o1, gain * o2), residual, added.own, table.noise)
    if learns_crosstalk(of) and not prior.position.born:
        slopes = t.slope1 / gain, t.slope2 / gain
        noise = add_products(
            noise, noise, t.u, gain, prior.variance, prior.products, slopes, of.X[row], table
        )
    return noise


@borrowed
@compiled
def _of_readings(
    of: Hypotheses,
    row: int,
    tangent: Tangent,
    noise: Root,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
    nuisance: Array,
) -> Linear:
    """Linearise readings at a mode; ``nuisance`` is filled with their nuisance Jacobian."""
    x, t, gain = of.x, tangent, frame.gain
    m1, m2 = t.value1 + prior.added.offset1, t.value2 + prior.added.offset2
    i, part = cell_of(t.u, table)
    for j in range(nuisance.shape[1]):
        g1, g2 = nuisance_at(i, part, j, table)
        nuisance[FIRST, j], nuisance[SECOND, j] = gain * g1, gain * g2
    along1, along2 = t.slope1, t.slope2
    e1, e2 = frame.first - m1, frame.second - m2
    if bends(table):
        away = 0.0 if prior.position.born else t.u - prior.position.centre
        root = add_root(noise, prior.added.own)
        slopes = t.slope1 / gain, t.slope2 / gain
        root = spread_at(root, told_at(t.u, prior), gain, slopes, of.X[row], table)
        pulls = solve(root, e1 - prior.added.slope1 * away, e2 - prior.added.slope2 * away)
        bend1, bend2 = bend_at(pulls, told_at(t.u, prior), gain, slopes, of.X[row], table)
        along1, along2 = along1 + prior.told * bend1, along2 + prior.told * bend2
    e1, e2 = e1 - along1 * (x[row, U] - t.at), e2 - along2 * (x[row, U] - t.at)
    return Linear(e1, e2, along1, along2, 0.0, 0.0, noise)


@compiled
def _take_moments(of: Hypotheses, row: int, mean: float, sd: float) -> None:
    """Give u the mean and standard deviation that were integrated along the curve, if they were.

    They hold what nuisance parameters do to u. Crosstalk follows u by all that u errs by: by what u
    errs by itself alone, far less beside a bright object, it would follow what the light hides.
    """
    x, X = of.x, of.X
    n, m = X.shape[1], X.shape[2]
    own = variance_of(of, row, U)
    if not (own > 0.0 and sd > 0.0):
        return
    stretch = sd / math.sqrt(own) - 1.0
    shift = mean - x[row, U]
    for i in range(n - 1, -1, -1):
        last = n if i < CROSSTALK1 else m
        slope, variance = 0.0, 0.0
        for j in range(last):
            slope += X[row, i, j] * X[row, U, j]
            variance += X[row, U, j] * X[row, U, j]
        slope /= variance
        x[row, i] += slope * shift
        for j in range(n):
            X[row, i, j] += slope * stretch * X[row, U, j]


@borrowed
@compiled
def learn(
    of: Hypotheses,
    row: int,
    candidate: TrackCandidate,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
    scratch: Scratch,
    held: bool,
) -> float:
    """Update a hypothesis at one mode of a frame.

    A Kalman step, linear at the mode, says what the frame tells about rate and crosstalk; the mean
    and standard deviation of u are then those that were integrated along the curve, if they were.

    Parameters
    ----------
    of, row : Hypotheses, int
        The hypothesis as it was predicted; changed in place.
    candidate : TrackCandidate
        The mode that is taken.
    frame, prior, table
        As for `log_density`.
    scratch : Scratch
        Overwritten.
    held : bool
        Whether crosstalk, where it is learnt, learns nothing (`inference.tracking.stillness`).

    Returns
    -------
    float
        Normalised innovation squared.
    """
    u, gain, born = candidate.mode, frame.gain, prior.position.born
    beside = 0.0
    if born:
        begin(of, row, u, prior.rate.sd)
    if frame.known_rate > 0.0:
        beside = take_known(of, row, u, born, frame, table, scratch)
        if learns_crosstalk(of) and not born:
            # what is read is held against what the known range leaves, and the curve taken there
            prior = own_prior(of, row, gain, 0.0, table, True)
    position = prior.position
    # where the curve is taken: as far as the error that u shares with the crosstalk goes, at u's
    # prediction
    at = u if born else position.centre + (1.0 - prior.share) * (u - position.centre)
    value1, value2, d1, d2 = mean_at(at, table)
    tangent = Tangent(u, at, gain * value1, gain * value2, gain * d1, gain * d2)
    noise = UNIT if table.by_rate else _noise_of(of, row, tangent, frame, prior, table)
    shares = learns_crosstalk(of) and not born
    held = held and shares
    shared = NOT_SHARED
    if shares:
        pull1, pull2 = solve(noise, tangent.slope1, tangent.slope2)
        told = pull1 * tangent.slope1 + pull2 * tangent.slope2
        unsure = slope_variance(at, gain, tangent.slope1, tangent.slope2, table)
        if not held:
            alone = (1.0 - prior.share) / position.precision
            bring_anchor(of, row, at, alone, told, unsure, table)
        along = at, tangent.slope1, tangent.slope2
        shared = straighten(of, row, gain, along, noise, table)
    if table.by_rate:
        readings = _of_derivatives(of, row, tangent, frame, prior)
    else:
        readings = _of_readings(of, row, tangent, noise, frame, prior, table, scratch.nuisance)
    surprise = update(of, row, readings, scratch, WITHOUT_CROSSTALK if held else of.X.shape[1])
    if shares:
        follow(of, row, shared, gain, table)
    if not held:
        _take_moments(of, row, candidate.mean, candidate.sd)
    if frame.known_rate > 0.0:
        # one number more is surprising; of an object that has just come it says where that is
        told = table.channels + (0.0 if born else 1.0)
        return (surprise + beside) * table.channels / told
    return surprise + 1.0 if born else surprise
