"""Where a frame and what is known before it agree: all modes along the range, and their mass."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import (
    GLOBALS,
    Curve,
    Prior,
    Triple,
    add_factor,
    log_density,
    mean_at,
)
from simulator.compiled import compiled

__all__ = ["CHOICE_COLUMNS", "REACH", "find_choices"]

Array = NDArray[np.float64]

REACH = 7.0  # standard deviations of a prediction that are searched
CHOICE_COLUMNS = 6  # log mass, mean, standard deviation, mode, its scale, parent
_CLOSE = 0.05  # standard deviations within which a mode has to be found
_GAUSSIAN = 0.3  # nats by which a peak may leave its parabola at sqrt(3) standard deviations
_DROP = 18.0  # nats below the top where a numerical integral ends
_PIECES = 2  # windows on either side of the middle one
_NEGLIGIBLE_PIECE = 1e-3  # share of a mode below which a piece is left out
_INTERVALS = 32  # of Simpson's rule on either side of a mode
_ROOT3 = math.sqrt(3.0)
_LOG_ROOT_2PI = 0.5 * math.log(2.0 * math.pi)


@compiled
def _climb_plain(
    u: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    root: Triple,
    curve: Curve,
) -> tuple[float, float]:
    """Climb by bracketed Gauss-Newton where the covariance is constant; the mode and its scale."""
    curvature = 0.0
    moved = high - low
    for _ in range(60):
        value1, value2, slope1, slope2 = mean_at(u, curve)
        away = 0.0 if prior.born else u - prior.centre
        e1 = first - prior.gain * value1 - prior.offset1 - prior.slope1 * away
        e2 = second - prior.gain * value2 - prior.offset2 - prior.slope2 * away
        t1 = (prior.gain * slope1 + prior.slope1) / root[0]
        t2 = (prior.gain * slope2 + prior.slope2 - root[1] * t1) / root[2]
        z1 = e1 / root[0]
        z2 = (e2 - root[1] * z1) / root[2]
        precision = 0.0 if prior.born else prior.precision
        slope = t1 * z1 + t2 * z2 - away * precision
        curvature = t1 * t1 + t2 * t2 + precision
        if slope > 0.0:
            low = u
        else:
            high = u
        step = slope / curvature if curvature > 0.0 else math.inf
        if abs(step) * math.sqrt(curvature) < _CLOSE or high - low < 1e-15 * (1.0 + abs(u)):
            break
        trial = u + step
        # Gauss-Newton overshoots where residuals are large: steps must shrink, or halve
        if not low < trial < high or abs(step) > 0.7 * moved:
            trial = 0.5 * (low + high)
        moved = abs(trial - u)
        u = trial
    return u, 1.0 / math.sqrt(curvature) if curvature > 0.0 else high - low


@compiled
def _climb(
    u: float,
    low: float,
    high: float,
    scale: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
) -> tuple[float, float]:
    """Climb by bracketed Newton with differences: the covariance changes along the way."""
    moved, width = high - low, high - low
    h = 0.3 * scale
    for _ in range(60):
        middle = log_density(u, first, second, prior, spread, curve)
        right = log_density(u + h, first, second, prior, spread, curve)
        left = log_density(u - h, first, second, prior, spread, curve)
        if left == -math.inf or right == -math.inf:
            # at an end of the support: one side alone tells the way
            if max(left, right) <= middle and h < 1e-3 * width:
                return u, h
            slope, curvature = right - left if max(left, right) > middle else 0.0, 0.0
            h *= 0.3
            if slope == 0.0:
                continue
        else:
            slope = (right - left) / (2.0 * h)
            curvature = -(right - 2.0 * middle + left) / (h * h)
        if slope > 0.0:
            low = u
        else:
            high = u
        trial = math.inf
        if curvature > 0.0:
            scale = 1.0 / math.sqrt(curvature)
            trial = u + slope / curvature
            # steps of the differences and of the peak must be alike before either is believed
            if abs(trial - u) < _CLOSE * scale and 0.02 * scale < h < scale:
                break
            h = min(0.3 * scale, 3.0 * h)
        else:
            h *= 0.5
        if high - low < 1e-14 * (1.0 + abs(u)):
            break
        if not low < trial < high or abs(trial - u) > 0.7 * moved:
            trial = 0.5 * (low + high)
        moved = abs(trial - u)
        u = trial
    return u, scale


@compiled
def _edge(
    u: float,
    top: float,
    end: float,
    scale: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
) -> float:
    """Return where the density has fallen to nothing on the way from a mode to an end."""
    step = math.copysign(scale, end - u)
    at = u
    while abs(end - at) > abs(step):
        at += step
        if log_density(at, first, second, prior, spread, curve) < top - _DROP:
            return at
        step *= 1.5
    return end


@compiled
def _place(choices: Array, count: int) -> int:
    """Return where the next choice goes: the end, or the place of the lightest one."""
    if count < choices.shape[0]:
        return count
    lightest = 0
    for j in range(count):
        if choices[j, 0] < choices[lightest, 0]:
            lightest = j
    return lightest


@compiled
def _add(
    choices: Array,
    count: int,
    log_mass: float,
    mean: float,
    sd: float,
    mode: float,
    scale: float,
    parent: float,
) -> int:
    """Append a choice; the new length."""
    place = _place(choices, count)
    choices[place, 0], choices[place, 1], choices[place, 2] = log_mass, mean, sd
    choices[place, 3], choices[place, 4], choices[place, 5] = mode, scale, parent
    return max(count, place + 1)


@compiled
def _divide(
    choices: Array,
    count: int,
    parent: float,
    u: float,
    scale: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
) -> int:
    """Append one mode that is not near a Gaussian, as at folds and ends of the support.

    Simpson's rule gives its moments. It is then divided by smooth windows, a standard deviation
    apart, into pieces that are near enough to Gaussians.
    """
    top = log_density(u, first, second, prior, spread, curve)
    begin = _edge(u, top, low, scale, first, second, prior, spread, curve)
    end = _edge(u, top, high, scale, first, second, prior, spread, curve)
    nodes = np.empty((2 * _INTERVALS + 2, 2))
    total, mean, square = 0.0, 0.0, 0.0
    for side in range(2):
        width = ((begin if side == 0 else end) - u) / _INTERVALS
        for k in range(_INTERVALS + 1):
            weight = 1.0 if k in (0, _INTERVALS) else (4.0 if k % 2 == 1 else 2.0)
            away = k * width
            density = log_density(u + away, first, second, prior, spread, curve)
            part = weight * abs(width) / 3.0 * math.exp(min(density - top, 50.0))
            row = side * (_INTERVALS + 1) + k
            nodes[row, 0], nodes[row, 1] = away, part
            total += part
            mean += part * away
            square += part * away * away
    if not total > 0.0:
        return count
    mean /= total
    sd = math.sqrt(max(square / total - mean * mean, 0.0))
    if not sd > 0.0:
        return _add(choices, count, top + math.log(total), u + mean, sd, u + mean, scale, parent)
    for piece in range(-_PIECES, _PIECES + 1):
        share, shift, square = 0.0, 0.0, 0.0
        for row in range(nodes.shape[0]):
            x = (nodes[row, 0] - mean) / sd
            windows = 0.0
            for other in range(-_PIECES, _PIECES + 1):
                windows += math.exp(-0.5 * (x - other) ** 2)
            part = nodes[row, 1] * math.exp(-0.5 * (x - piece) ** 2) / windows
            share += part
            shift += part * x
            square += part * x * x
        if share > _NEGLIGIBLE_PIECE * total:
            shift /= share
            own = sd * math.sqrt(max(square / share - shift * shift, 0.0))
            at = u + mean + sd * shift
            count = _add(choices, count, top + math.log(share), at, own, at, own, parent)
    return count


@compiled
def _integrate(
    choices: Array,
    count: int,
    parent: float,
    u: float,
    scale: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
    linear: bool,
) -> int:
    """Append one mode between its valleys, with its log mass, mean and standard deviation.

    Three Gauss-Hermite nodes where the peak is near a Gaussian, which is exact to the fifth power
    of the distance.

    Where u is wide because globals or crosstalk are uncertain, only the mode is taken. What they do
    to the readings is linear here, and the curve is not: integrated over a wide density, the
    difference would pass for knowledge of the range, a little in every frame.
    """
    if linear:
        top = log_density(u, first, second, prior, spread, curve)
        log_mass = top + math.log(scale) + _LOG_ROOT_2PI
        return _add(choices, count, log_mass, u, 0.0, u, scale, parent)
    if u - _ROOT3 * scale >= low and u + _ROOT3 * scale <= high:
        top = log_density(u, first, second, prior, spread, curve)
        left = log_density(u - _ROOT3 * scale, first, second, prior, spread, curve) - top + 1.5
        right = log_density(u + _ROOT3 * scale, first, second, prior, spread, curve) - top + 1.5
        if abs(left) < _GAUSSIAN and abs(right) < _GAUSSIAN:
            left, right = math.exp(left), math.exp(right)
            mass = (4.0 + left + right) / 6.0
            shift = _ROOT3 * (right - left) / (6.0 * mass)
            sd = scale * math.sqrt(0.5 * (left + right) / mass - shift * shift)
            log_mass = top + math.log(mass * scale) + _LOG_ROOT_2PI
            return _add(choices, count, log_mass, u + shift * scale, sd, u, scale, parent)
    return _divide(choices, count, parent, u, scale, low, high, first, second, prior, spread, curve)


@compiled
def find_choices(
    choices: Array,
    count: int,
    parent: float,
    first: float,
    second: float,
    prior: Prior,
    spread: Array,
    curve: Curve,
    scan: Array,
    next_scan: NDArray[np.int64],
    values: Array,
) -> int:
    """Append every mode of a frame under one prior to a list.

    Parameters
    ----------
    choices : ndarray, shape (capacity, CHOICE_COLUMNS)
        The list; where it is full, its lightest member gives way.
    count : int
        Its length so far.
    parent : float
        What the last column says.
    first, second : float
        Readings in units of the read noise.
    prior, spread, curve
        As for `log_density`.
    scan : ndarray, shape (s,)
        Log ranges between which the curve is near straight, ascending from its start to its end.
    next_scan : ndarray of int, shape (knots,)
        Index of the first of them at or after each knot.
    values : ndarray, shape (at least s + 2, 2)
        Overwritten.

    Returns
    -------
    int
        The new length.
    """
    low, high, width = curve.start, curve.end, curve.end - curve.start
    if not prior.born:
        width = 1.0 / math.sqrt(prior.precision)
        low = max(low, prior.centre - REACH * width)
        high = min(high, prior.centre + REACH * width)
        if not low < high:  # gone beyond the support
            return count
    plain = curve.plain and not curve.by_rate
    linear = spread.shape[1] > 2
    plain = plain and not (prior.born and curve.table.shape[1] > GLOBALS)
    root = add_factor((1.0, 0.0, 1.0), prior.root11, prior.root21)
    root = add_factor(root, 0.0, prior.root22)
    k = next_scan[min(max(int((low - curve.start) / curve.step), 0), next_scan.size - 1)]
    values[0, 0] = low
    points = 1
    while k < scan.size and scan[k] < high:
        if scan[k] > low:
            values[points, 0] = scan[k]
            points += 1
        k += 1
    values[points, 0] = high
    points += 1
    # with one knot within reach the curve is near straight over all of it
    single = points <= 3 and not prior.born
    if not single:
        for j in range(points):
            values[j, 1] = log_density(values[j, 0], first, second, prior, spread, curve)
    valley = 0
    for j in range(1 if single else points):
        start, below, above = min(max(prior.centre, low), high), low, high
        left, right = low, high
        if not single:
            before = values[j - 1, 1] if j > 0 else -math.inf
            after = values[j + 1, 1] if j + 1 < points else -math.inf
            if not before <= values[j, 1] > after:
                continue
            last = j
            while last + 1 < points and values[last + 1, 1] <= values[last, 1]:
                last += 1
            left, right = values[valley, 0], values[last, 0]
            valley = last
            start = values[j, 0]
            below, above = values[max(j - 1, 0), 0], values[min(j + 1, points - 1), 0]
        if plain:
            u, scale = _climb_plain(start, below, above, first, second, prior, root, curve)
        else:
            scale = min(width, above - below)
            u, scale = _climb(start, below, above, scale, first, second, prior, spread, curve)
        count = _integrate(
            choices,
            count,
            parent,
            u,
            scale,
            left,
            right,
            first,
            second,
            prior,
            spread,
            curve,
            linear,
        )
    return count
