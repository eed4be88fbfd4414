"""The density of one frame along its range, with what is known before the frame."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.hypotheses import CROSSTALK1, CROSSTALK2, WITHOUT_CROSSTALK, U
from inference.tracking.light import noise_at_light
from inference.tracking.readings_table import (
    FIRST,
    LOG_PRIOR,
    SECOND,
    ReadingsTable,
    cell_of,
    mean_at,
    nuisance_at,
    nuisance_count,
    nuisance_root,
    object_at,
)
from inference.tracking.roots import UNIT, Root, add_factor, add_root, slope_of
from simulator.compiled import compiled

__all__ = [
    "Added",
    "Position",
    "Prior",
    "Rate",
    "TrackedFrame",
    "bend_at",
    "expected_at",
    "felt_at",
    "log_density",
    "log_known",
    "spread_at",
    "taken_at",
    "told_at",
]

Array = NDArray[np.float64]


class TrackedFrame(NamedTuple):
    """One frame: two readings in units of the read noise, and its factor on the sensor's gain."""

    first: float
    second: float
    gain: float
    # the range that is known beside them [m], and one over its standard deviation [1/m], which is 0
    # where none is: at run time, so that a stream has the same answers however it is cut
    known_m: float = 0.0
    known_rate: float = 0.0


class Position(NamedTuple):
    """The prior density of u."""

    born: bool  # whether u has the prior density of the ranges instead of a normal one
    again: bool  # whether it had so in frames before: an object that may be anywhere by now
    alone: bool  # whether it is the first object that is followed, before crosstalk that is learnt
    # of a normal u; the log of sqrt(precision / 2 pi), for a born u the log of its weight
    centre: float
    precision: float
    log_scale: float


class Added(NamedTuple):
    """What crosstalk and nuisance parameters add to the readings, normal given u."""

    # what the crosstalk adds at the centre
    offset1: float
    offset2: float
    # change with u of what crosstalk and nuisance parameters add
    slope1: float
    slope2: float
    own: Root  # of the covariance that crosstalk adds
    # of that with nuisance parameters and what `inference.tracking.second_order` adds, both at the
    # prediction
    root: Root
    # root of the covariance, as what nuisance parameters add depends on u: (n, n + p) of a
    # hypothesis; (2, n + p) of the crosstalk in the empty scene where the prior is born
    spread: Array


class Rate(NamedTuple):
    """Mean at the centre of u, change with u, and standard deviation given u, of du/dt."""

    mean: float
    slope: float
    sd: float


class Prior(NamedTuple):
    """What is known of a frame before it is read, as a density of u and what is normal given u."""

    position: Position  # of u
    added: Added  # to the readings
    rate: Rate  # of u
    # part of the variance of u that comes from crosstalk that is not known: along it the curve
    # counts as straight (`inference.tracking.shared_error`). 0 where u is what it errs by itself
    share: float
    # part along which nuisance parameters are taken where the frame says that they are: what is not
    # shared, as far as crosstalk is known too well to take up what they do
    told: float
    products: float  # the same, of all that u errs
    variance: float  # of all that u errs


@compiled
def log_known(u: float, frame: TrackedFrame) -> float:
    """Return the log density of what is known of the range beside the readings, at one u."""
    off = (math.exp(u) - frame.known_m) * frame.known_rate
    return -0.5 * off * off


@compiled
def taken_at(u: float, prior: Prior) -> float:
    """Return the log r at which the curve is taken: as far as an error is shared, the centre."""
    if prior.share == 0.0:
        return u
    return prior.position.centre + (1.0 - prior.share) * (u - prior.position.centre)


@compiled
def told_at(u: float, prior: Prior) -> float:
    """Return the log r at which nuisance parameters are taken: the centre where none are told."""
    if prior.told == 1.0 or prior.position.born:
        return u
    return prior.position.centre + prior.told * (u - prior.position.centre)


@compiled
def expected_at(u: float, prior: Prior, table: ReadingsTable) -> tuple[float, float, float, float]:
    """Return the two mean readings and their derivatives along u, straight along a shared error.

    What is linear in u, the error's own part included, is in the prior's slopes.
    """
    if prior.share == 0.0:
        return mean_at(u, table)
    own = 1.0 - prior.share
    value1, value2, d1, d2 = mean_at(taken_at(u, prior), table)
    return value1, value2, own * d1, own * d2


@compiled
def _log_prior(u: float, position: Position, table: ReadingsTable) -> float:
    """Return the log prior density of u."""
    if position.born:
        i, t = cell_of(u, table)
        low, high = table.knots[i, LOG_PRIOR], table.knots[i + 1, LOG_PRIOR]
        return float(position.log_scale + low + t * (high - low))
    away = u - position.centre
    return position.log_scale - 0.5 * away * away * position.precision


@compiled
def _add_at(root: Root, u: float, gain: float, added: Added, table: ReadingsTable) -> Root:
    """Add what crosstalk and nuisance parameters do to the readings at one u."""
    i, t = cell_of(u, table)
    spread = added.spread
    own = spread.shape[1] - nuisance_count(table)
    if own == WITHOUT_CROSSTALK:
        return add_root(root, nuisance_root(u, gain, table))
    for j in range(spread.shape[1]):
        f1, f2 = spread[FIRST, j], spread[SECOND, j]
        if j >= own:
            g1, g2 = nuisance_at(i, t, j - own, table)
            f1, f2 = f1 + gain * g1, f2 + gain * g2
        root = add_factor(root, f1, f2)
    return root


@compiled
def felt_at(
    j: int,
    i: int,
    t: float,
    gain: float,
    slopes: tuple[float, float],
    X: Array,
    table: ReadingsTable,
) -> tuple[float, float]:
    """Return what nuisance parameter j does to the readings beyond what it has done to the range.

    Parameters
    ----------
    j : int
        The parameter.
    i, t : int, float
        Where: knot and share of the cell, as by `cell_of`.
    gain : float
        The frame's factor on the sensor's gain.
    slopes : (float, float)
        Derivatives of the readings along u there, without that factor.
    X : ndarray, shape (n, n + p)
        Root of a hypothesis' covariance.
    """
    n = X.shape[0]
    f1, f2 = nuisance_at(i, t, j, table)
    f1, f2 = gain * (f1 + slopes[0] * X[U, n + j]), gain * (f2 + slopes[1] * X[U, n + j])
    if n > WITHOUT_CROSSTALK:
        f1, f2 = f1 + X[CROSSTALK1, n + j], f2 + X[CROSSTALK2, n + j]
    return f1, f2


@compiled
def spread_at(
    root: Root,
    u: float,
    gain: float,
    slopes: tuple[float, float],
    X: Array,
    table: ReadingsTable,
) -> Root:
    """Add what nuisance parameters do to the readings of a hypothesis at one u.

    The filter runs at their centre: to it that is noise.

    Parameters
    ----------
    root : Root
        Of the covariance without them.
    u, gain, slopes, X, table
        As for `felt_at`, at u.
    """
    i, t = cell_of(u, table)
    count = X.shape[1] - X.shape[0]
    square, product = root.r11 * root.r11, root.r11 * root.r21
    for j in range(count):
        f1, f2 = felt_at(j, i, t, gain, slopes, X, table)
        square += f1 * f1
        product += f1 * f2
    ratio = slope_of(product, square)
    off = root.r21 - ratio * root.r11
    rest = root.r22 * root.r22 + off * off
    for j in range(count):
        f1, f2 = felt_at(j, i, t, gain, slopes, X, table)
        off = f2 - ratio * f1
        rest += off * off
    length = math.sqrt(square)
    return Root(length, ratio * length, math.sqrt(rest))


@compiled
def bend_at(
    pulls: tuple[float, float],
    u: float,
    gain: float,
    slopes: tuple[float, float],
    X: Array,
    table: ReadingsTable,
) -> tuple[float, float]:
    """Return how what nuisance parameters do to the readings changes along u.

    They are where the readings say that they are, given u. Without it a range would be corrected by
    as much too far as the readings are larger than at their centre.

    Parameters
    ----------
    pulls : (float, float)
        Inverse of the whole covariance times the residuals.
    u, gain, slopes, X, table
        As for `spread_at`.
    """
    i, t = cell_of(u, table)
    bend1, bend2 = 0.0, 0.0
    for j in range(X.shape[1] - X.shape[0]):
        f1, f2 = felt_at(j, i, t, gain, slopes, X, table)
        value = f1 * pulls[0] + f2 * pulls[1]
        here1, here2 = nuisance_at(i, 0.0, j, table)
        next1, next2 = nuisance_at(i, 1.0, j, table)
        bend1 += value * (next1 - here1)
        bend2 += value * (next2 - here2)
    return gain * bend1 / table.step, gain * bend2 / table.step


@borrowed
@compiled
def log_density(u: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable) -> float:
    """Return log p(readings, u), the log of 2 pi per reading left out.

    What nuisance parameters add to the readings of a hypothesis is taken at its prediction
    (`inference.tracking.mode_refinement` takes it at the mode).

    Parameters
    ----------
    u : float
        log r; outside the table the density is zero.
    frame : TrackedFrame
        The frame.
    prior : Prior
        What is known beforehand.
    table : ReadingsTable
        Mean readings and their noise.
    """
    if not table.start <= u <= table.end:
        return -math.inf
    position, added = prior.position, prior.added
    value1, value2, _, _ = expected_at(u, prior, table)
    value1, value2 = value1 * frame.gain, value2 * frame.gain
    away = 0.0 if position.born else u - position.centre
    root = UNIT
    if table.by_rate:
        rate = prior.rate.mean + prior.rate.slope * away
        e1, e2 = frame.first - value1 * rate, frame.second - value2 * rate
        root = add_factor(root, value1 * prior.rate.sd, value2 * prior.rate.sd)
    else:
        m1, m2 = value1 + added.offset1, value2 + added.offset2
        e1 = frame.first - m1 - added.slope1 * away
        e2 = frame.second - m2 - added.slope2 * away
        if not table.noise.plain:
            o1, o2 = object_at(u, table)
            mean = m1 + added.slope1 * away, m2 + added.slope2 * away
            signal = o1 * frame.gain, o2 * frame.gain
            root = noise_at_light(mean, signal, (e1, e2), added.own, table.noise)
        if position.born and nuisance_count(table) > 0:
            root = _add_at(root, u, frame.gain, added, table)
        elif added.root.r11 > 0.0 or added.root.r22 > 0.0:
            root = add_root(root, added.root)
    z1 = e1 / root.r11
    z2 = (e2 - root.r21 * z1) / root.r22
    value = -0.5 * (z1 * z1 + z2 * z2) + _log_prior(u, position, table)
    if frame.known_rate > 0.0:
        value += log_known(u, frame)
    scale = root.r11 * root.r22
    return value if scale == 1.0 else value - math.log(scale)
