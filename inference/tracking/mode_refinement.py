"""A mode where what nuisance parameters add to the readings is taken at the mode itself.

An object whose light is twice what is expected reads the same phase, at twice the distance from the
origin. Taken where the object was predicted to be, the direction of that error is off by as much as
the object has moved, and a range would be corrected by twice as much as it is off.
"""

import math
from typing import NamedTuple

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import (
    Prior,
    TrackedFrame,
    bend_at,
    log_known,
    spread_at,
    taken_at,
    told_at,
)
from inference.tracking.hypotheses import WITHOUT_CROSSTALK
from inference.tracking.light import noise_at_light
from inference.tracking.readings_table import ReadingsTable, mean_at, nuisance_count, object_at
from inference.tracking.roots import UNIT, add_root, solve
from inference.tracking.second_order import add_products
from simulator.compiled import compiled

__all__ = ["PeakedMode", "bends", "refined"]

_CLOSE = 0.05  # standard deviations within which a mode has to be found
_STEPS = 8
_HALVINGS = 4


class PeakedMode(NamedTuple):
    """One mode of a density along the range."""

    # its place and its scale, log range
    u: float
    scale: float
    # the valleys on either side, log range
    low: float
    high: float


@compiled
def bends(table: ReadingsTable) -> bool:
    """Tell whether the direction of what nuisance parameters add is taken at the mode.

    Along what range and crosstalk err in common the curve counts as straight, and is taken at the
    prediction (`taken_at`): a slope that turns with every frame would pass for knowledge. One
    reading alone has no direction.
    """
    return nuisance_count(table) > 0 and table.channels == 2


class _Here(NamedTuple):
    """A density at one u, the nuisance parameters where the readings say that they are."""

    log_density: float
    # its derivative along u, and its curvature by Gauss and Newton; of the determinant neither
    slope: float
    curvature: float


@compiled
def _density(u: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable) -> _Here:
    position, added, gain = prior.position, prior.added, frame.gain
    away, own = u - position.centre, 1.0 - prior.share
    value1, value2, slope1, slope2 = mean_at(taken_at(u, prior), table)
    at = told_at(u, prior)
    m1 = gain * value1 + added.offset1 + added.slope1 * away
    m2 = gain * value2 + added.offset2 + added.slope2 * away
    e1, e2 = frame.first - m1, frame.second - m2
    root = UNIT
    if not table.noise.plain:
        o1, o2 = object_at(u, table)
        root = noise_at_light((m1, m2), (gain * o1, gain * o2), (e1, e2), added.own, table.noise)
    slopes, noise = (slope1, slope2), root
    root = add_root(root, added.own)
    if added.spread.shape[0] > WITHOUT_CROSSTALK:
        # at the mode, as in what is learnt there: where the prediction is vague, what it says of
        # their size holds nowhere else
        root = add_products(
            root, noise, u, gain, prior.variance, prior.products, slopes, added.spread, table
        )
    root = spread_at(root, at, gain, slopes, added.spread, table)
    pulls = solve(root, e1, e2)
    bend1, bend2 = bend_at(pulls, at, gain, slopes, added.spread, table)
    t1 = (own * gain * slope1 + prior.told * bend1 + added.slope1) / root.r11
    t2 = (own * gain * slope2 + prior.told * bend2 + added.slope2 - root.r21 * t1) / root.r22
    z1 = e1 / root.r11
    z2 = (e2 - root.r21 * z1) / root.r22
    value = position.log_scale - 0.5 * (z1 * z1 + z2 * z2 + away * away * position.precision)
    slope = t1 * z1 + t2 * z2 - away * position.precision
    curvature = t1 * t1 + t2 * t2 + position.precision
    if frame.known_rate > 0.0:
        value += log_known(u, frame)
        along = math.exp(u) * frame.known_rate
        slope += (frame.known_m * frame.known_rate - along) * along
        curvature += along * along
    return _Here(value - math.log(root.r11 * root.r22), slope, curvature)


@borrowed
@compiled
def refined(
    mode: PeakedMode, frame: TrackedFrame, prior: Prior, table: ReadingsTable
) -> tuple[float, float, float]:
    """Climb from a mode of the density whose covariance is that at the prediction.

    Parameters
    ----------
    mode : PeakedMode
        Where to begin, and the valleys that are not left.
    frame, prior, table
        As for `log_density`; the prior is that of a hypothesis.

    Returns
    -------
    (float, float, float)
        The mode, its scale, and the log density there.
    """
    u = mode.u
    here = _density(u, frame, prior, table)
    for _ in range(_STEPS):
        step = here.slope / here.curvature
        if abs(step) * math.sqrt(here.curvature) < _CLOSE:
            break
        better = False
        for _ in range(_HALVINGS):
            trial = min(max(u + step, mode.low), mode.high)
            there = _density(trial, frame, prior, table)
            if there.log_density > here.log_density:
                better = True
                break
            step *= 0.5
        if not better:
            break
        u, here = trial, there
    return u, 1.0 / math.sqrt(here.curvature), here.log_density
