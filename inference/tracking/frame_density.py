"""The density of one frame along its range, with what is known before the frame."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.borrowed import borrowed
from inference.tracking.readings_table import (
    FIRST,
    LOG_PRIOR,
    SECOND,
    ReadingsTable,
    cell_of,
    mean_at,
    noise_root,
    nuisance_at,
    nuisance_count,
    nuisance_root,
    object_at,
)
from inference.tracking.roots import UNIT, Root, add_factor, add_root
from simulator.compiled import compiled

__all__ = [
    "Added",
    "Position",
    "Prior",
    "Rate",
    "TrackedFrame",
    "expected_at",
    "log_density",
    "log_known",
]

Array = NDArray[np.float64]

_WITHOUT_CROSSTALK = 2  # own states of a hypothesis that does not learn it


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
    root: Root  # of the covariance that they add
    # (2, n + p): root of the crosstalk's covariance in the empty scene; read where the prior is
    # born, because what nuisance parameters add then depends on u
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
    # counts as straight (`inference.tracking.shared_error`)
    share: float


@compiled
def log_known(u: float, frame: TrackedFrame) -> float:
    """Return the log density of what is known of the range beside the readings, at one u."""
    off = (math.exp(u) - frame.known_m) * frame.known_rate
    return -0.5 * off * off


@compiled
def expected_at(u: float, prior: Prior, table: ReadingsTable) -> tuple[float, float, float, float]:
    """Return the two mean readings and their derivatives along u, straight along a shared error.

    What is linear in u, the error's own part included, is in the prior's slopes.
    """
    if prior.share == 0.0:
        return mean_at(u, table)
    own = 1.0 - prior.share
    centre = prior.position.centre
    value1, value2, d1, d2 = mean_at(centre + own * (u - centre), table)
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
    if own == _WITHOUT_CROSSTALK:
        return add_root(root, nuisance_root(u, gain, table))
    for j in range(spread.shape[1]):
        f1, f2 = spread[FIRST, j], spread[SECOND, j]
        if j >= own:
            g1, g2 = nuisance_at(i, t, j - own, table)
            f1, f2 = f1 + gain * g1, f2 + gain * g2
        root = add_factor(root, f1, f2)
    return root


@borrowed
@compiled
def log_density(u: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable) -> float:
    """Return log p(readings, u), the log of 2 pi per reading left out.

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
            root = noise_root(m1, m2, o1 * frame.gain, o2 * frame.gain, table.noise)
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
