"""The curve of mean readings as a table, and the density of a frame along it.

The filter knows no optics: it sees a curve in the plane of the readings, tabulated over u = log r
in units of the read noise, its derivatives, and what the uncertain globals do to it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = [
    "GLOBALS",
    "GROUP",
    "Curve",
    "Places",
    "Prior",
    "Triple",
    "add_factor",
    "cell_of",
    "column_at",
    "expected_at",
    "log_density",
    "mass_bound",
    "mean_at",
    "noise_root",
    "object_at",
    "prior_term",
]

Array = NDArray[np.float64]
Triple = tuple[float, float, float]


GROUP = 16  # boxes
_UNSEEN = 120.0  # square of the distance beyond which a box holds nothing of a density
# columns of a curve's table
MEAN, SIGNAL, LOG_PRIOR, GLOBALS = 0, 4, 8, 9


class Curve(NamedTuple):
    """What a frame's readings are expected to be, as a function of u = log r.

    Attributes
    ----------
    table : ndarray, shape (knots, 9 + 2 p)
        Mean readings in units of the read noise and their derivatives along u times ``step``, the
        object's part of both, log prior density of u, and the change of either reading with each of
        p independent standard normal globals. By rate the means are factors of du/dt.
    start, step : float
        First knot and spacing of u.
    end : float
        Last knot.
    crosstalk1, crosstalk2 : float
        Known crosstalk.
    by_rate : bool
        Whether the readings are derivatives in time.
    plain : bool
        Whether the noise does not depend on the range.
    shot1, shot2 : float
        Shot noise variance per mean reading, both in units of the read noise.
    ratio : float
        Read noise of the first reading over that of the second.
    relative : float
        Common relative error of the object's signal.
    pulsed : bool
        Whether shot noise is shared by both readings.
    channels : int
        How many of the two readings are used.
    """

    table: Array
    start: float
    step: float
    end: float
    crosstalk1: float
    crosstalk2: float
    by_rate: bool
    plain: bool
    shot1: float
    shot2: float
    ratio: float
    relative: float
    pulsed: bool
    channels: int


class Places(NamedTuple):
    """What goes with a curve, and is needed once a frame.

    Attributes
    ----------
    scan : ndarray, shape (s,)
        Log ranges between which the curve is near straight, ascending, both ends among them.
    next_scan : ndarray of int, shape (knots,)
        Index of the first of them at or after each knot.
    empty : ndarray, shape (2, 1 + p)
        Readings of the empty scene without crosstalk, and their change with the globals.
    boxes : ndarray, shape (s - 1, 6)
        Of every stretch between two places: least and greatest first and second reading, its prior
        probability, and a bound of what it holds of any frame's density.
    groups : ndarray, shape (g, 4)
        Boxes around every `GROUP` boxes.
    """

    scan: Array
    next_scan: NDArray[np.int64]
    empty: Array
    boxes: Array
    groups: Array


class Prior(NamedTuple):
    """What is known of a frame before it is read, as a density of u and what is normal given u.

    Attributes
    ----------
    born : bool
        Whether u has the prior law of ranges instead of a normal one.
    centre, precision, log_scale : float
        Of a normal u; the log of sqrt(precision / 2 pi), for a born u the log of its weight.
    offset1, offset2 : float
        What the crosstalk adds to the readings at the centre.
    slope1, slope2 : float
        Change with u of what crosstalk and globals add to the readings.
    root11, root21, root22 : float
        Triangular root of the covariance that they add.
    rate, rate_slope, rate_sd : float
        Mean at the centre, change with u and standard deviation of du/dt given u.
    gain : float
        The frame's factor on the sensor's gain.
    share : float
        Part of the variance of u that comes from crosstalk that is not known: along it the curve
        counts as straight (`inference.tracking.shared_error`).
    """

    born: bool
    centre: float
    precision: float
    log_scale: float
    offset1: float
    offset2: float
    slope1: float
    slope2: float
    root11: float
    root21: float
    root22: float
    rate: float
    rate_slope: float
    rate_sd: float
    gain: float
    share: float


@compiled
def _gap(value: float, low: float, high: float) -> float:
    """Return the distance of a value from an interval."""
    return max(low - value, value - high, 0.0)


@compiled
def mass_bound(
    first: float, second: float, gain: float, n: int, curve: Curve, places: Places
) -> float:
    """Return an upper bound of a frame's density averaged over the law of ranges.

    A stretch of the curve lies in a box, and no reading is nearer to it than to the box; on a
    stretch whose every piece advances along its chord the density integrates to at most
    sqrt(2 pi) over the least speed. Where globals or crosstalk are uncertain or the noise depends
    on the range only that no density exceeds its top is used.
    """
    if not curve.plain or curve.by_rate or n > 2 or curve.table.shape[1] > GLOBALS:
        return 1.0
    y1, y2 = (first - curve.crosstalk1) / gain, (second - curve.crosstalk2) / gain
    total = 0.0
    farthest = _UNSEEN / gain / gain
    groups, boxes = places.groups, places.boxes
    for g in range(groups.shape[0]):
        d1, d2 = _gap(y1, groups[g, 0], groups[g, 1]), _gap(y2, groups[g, 2], groups[g, 3])
        if d1 * d1 + d2 * d2 > farthest:
            continue
        for j in range(g * GROUP, min((g + 1) * GROUP, boxes.shape[0])):
            d1, d2 = _gap(y1, boxes[j, 0], boxes[j, 1]), _gap(y2, boxes[j, 2], boxes[j, 3])
            square = d1 * d1 + d2 * d2
            if square <= farthest:
                near = boxes[j, 4] * math.exp(-0.5 * square * gain * gain)
                total += min(near, boxes[j, 5] / gain)
    return total + math.exp(-0.5 * _UNSEEN)


@compiled
def _hermite(u: float, curve: Curve, first: int) -> tuple[float, float, float, float]:
    """Interpolate two columns and their derivatives, cubically."""
    position = (u - curve.start) / curve.step
    p = curve.table
    i = min(max(int(position), 0), p.shape[0] - 2)
    t = position - i
    a1, a2, left1, left2 = p[i, first], p[i, first + 1], p[i, first + 2], p[i, first + 3]
    right1, right2 = p[i + 1, first + 2], p[i + 1, first + 3]
    gap1, gap2 = p[i + 1, first] - a1, p[i + 1, first + 1] - a2
    c1, d1 = 3.0 * gap1 - 2.0 * left1 - right1, left1 + right1 - 2.0 * gap1
    c2, d2 = 3.0 * gap2 - 2.0 * left2 - right2, left2 + right2 - 2.0 * gap2
    return (
        a1 + t * (left1 + t * (c1 + t * d1)),
        a2 + t * (left2 + t * (c2 + t * d2)),
        (left1 + t * (2.0 * c1 + 3.0 * t * d1)) / curve.step,
        (left2 + t * (2.0 * c2 + 3.0 * t * d2)) / curve.step,
    )


@compiled
def mean_at(u: float, curve: Curve) -> tuple[float, float, float, float]:
    """Return the two mean readings and their derivatives along u."""
    return _hermite(u, curve, MEAN)


@compiled
def expected_at(u: float, prior: Prior, curve: Curve) -> tuple[float, float, float, float]:
    """Return the two mean readings and their derivatives along u, straight along a shared error.

    What is linear in u, the error's own part included, is in the prior's slopes.
    """
    if prior.share == 0.0:
        return mean_at(u, curve)
    own = 1.0 - prior.share
    value1, value2, d1, d2 = mean_at(prior.centre + own * (u - prior.centre), curve)
    return value1, value2, own * d1, own * d2


@compiled
def object_at(u: float, curve: Curve) -> tuple[float, float]:
    """Return the object's part of the readings."""
    value1, value2, _, _ = _hermite(u, curve, SIGNAL)
    return value1, value2


@compiled
def cell_of(u: float, curve: Curve) -> tuple[int, float]:
    """Return the knot before u and the share of the cell that lies before u."""
    position = (u - curve.start) / curve.step
    i = min(max(int(position), 0), curve.table.shape[0] - 2)
    return i, min(max(position - i, 0.0), 1.0)


@compiled
def column_at(i: int, t: float, j: int, curve: Curve) -> tuple[float, float]:
    """Return the change of the readings with global j, in the cell after knot i."""
    p = curve.table
    k = GLOBALS + 2 * j
    return p[i, k] + t * (p[i + 1, k] - p[i, k]), p[i, k + 1] + t * (p[i + 1, k + 1] - p[i, k + 1])


@compiled
def add_factor(root: Triple, first: float, second: float) -> Triple:
    """Return the triangular root of root root^T + f f^T, by one rotation: nothing cancels.

    Parameters
    ----------
    root : (float, float, float)
        Lower triangular: elements 11, 21, 22.
    first, second : float
        The vector f.
    """
    length = math.sqrt(root[0] * root[0] + first * first)
    if first == 0.0 or length == 0.0:  # nothing, or squares that underflow
        return root[0], root[1], math.sqrt(root[2] * root[2] + second * second)
    cosine, sine = root[0] / length, first / length
    rest = cosine * second - sine * root[1]
    return length, cosine * root[1] + sine * second, math.sqrt(root[2] * root[2] + rest * rest)


@compiled
def noise_root(m1: float, m2: float, o1: float, o2: float, curve: Curve) -> Triple:
    """Return the triangular root of the noise's covariance at mean readings m, object's part o."""
    root = (1.0, 0.0, 1.0)
    if curve.shot1 > 0.0 or curve.shot2 > 0.0:
        first, second = curve.shot1 * abs(m1), curve.shot2 * abs(m2)
        if not curve.pulsed:
            root = (math.sqrt(1.0 + first), 0.0, math.sqrt(1.0 + second))
        elif abs(m1) * curve.ratio <= abs(m2):
            own = second - first * curve.ratio * curve.ratio
            root = (1.0, 0.0, math.sqrt(1.0 + max(own, 0.0)))
            shared = math.sqrt(first)
            root = add_factor(root, shared, shared * curve.ratio)
        else:
            own = first - second / curve.ratio / curve.ratio
            root = (math.sqrt(1.0 + max(own, 0.0)), 0.0, 1.0)
            shared = math.sqrt(second)
            root = add_factor(root, shared / curve.ratio, shared)
    if curve.relative > 0.0:
        root = add_factor(root, curve.relative * o1, curve.relative * o2)
    return root


@compiled
def prior_term(u: float, prior: Prior, curve: Curve) -> float:
    """Return the log prior density of u."""
    if prior.born:
        i, t = cell_of(u, curve)
        low, high = curve.table[i, LOG_PRIOR], curve.table[i + 1, LOG_PRIOR]
        return float(prior.log_scale + low + t * (high - low))
    away = u - prior.centre
    return prior.log_scale - 0.5 * away * away * prior.precision


@compiled
def log_density(
    u: float, first: float, second: float, prior: Prior, spread: Array, curve: Curve
) -> float:
    """Return log p(readings, u), the log of 2 pi per reading left out.

    Parameters
    ----------
    u : float
        log r; outside the table the density is zero.
    first, second : float
        Readings in units of the read noise.
    prior : Prior
        What is known beforehand.
    spread : ndarray, shape (2, n + p)
        Root of the crosstalk's covariance; read where the prior is born, because what globals add
        then depends on u.
    curve : Curve
        The curve.
    """
    if not curve.start <= u <= curve.end:
        return -math.inf
    value1, value2, _, _ = expected_at(u, prior, curve)
    value1, value2 = value1 * prior.gain, value2 * prior.gain
    away = 0.0 if prior.born else u - prior.centre
    if curve.by_rate:
        rate = prior.rate + prior.rate_slope * away
        e1, e2 = first - value1 * rate, second - value2 * rate
        root = (1.0, 0.0, 1.0)
        root = add_factor(root, value1 * prior.rate_sd, value2 * prior.rate_sd)
    else:
        m1, m2 = value1 + prior.offset1, value2 + prior.offset2
        e1 = first - m1 - prior.slope1 * away
        e2 = second - m2 - prior.slope2 * away
        root = (1.0, 0.0, 1.0)
        if not curve.plain:
            o1, o2 = object_at(u, curve)
            root = noise_root(m1, m2, o1 * prior.gain, o2 * prior.gain, curve)
        globals_count = (curve.table.shape[1] - GLOBALS) // 2
        if prior.born and globals_count > 0:
            i, t = cell_of(u, curve)
            own = spread.shape[1] - globals_count
            for j in range(spread.shape[1]):
                f1, f2 = spread[0, j], spread[1, j]
                if j >= own:
                    g1, g2 = column_at(i, t, j - own, curve)
                    f1, f2 = f1 + prior.gain * g1, f2 + prior.gain * g2
                root = add_factor(root, f1, f2)
        elif prior.root11 > 0.0 or prior.root22 > 0.0:
            root = add_factor(root, prior.root11, prior.root21)
            root = add_factor(root, 0.0, prior.root22)
    z1 = e1 / root[0]
    z2 = (e2 - root[1] * z1) / root[2]
    value = -0.5 * (z1 * z1 + z2 * z2) + prior_term(u, prior, curve)
    scale = root[0] * root[2]
    return value if scale == 1.0 else value - math.log(scale)
