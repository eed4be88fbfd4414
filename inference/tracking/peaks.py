"""A peak of the density along the range: its top, and where it ends."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import Curve, Prior, Triple, expected_at, log_density
from simulator.compiled import compiled

__all__ = ["climb", "climb_plain", "edge"]

Array = NDArray[np.float64]

_CLOSE = 0.05  # standard deviations within which a mode has to be found
_DROP = 18.0  # nats below the top where a numerical integral ends


@compiled
def climb_plain(
    u: float,
    low: float,
    high: float,
    first: float,
    second: float,
    prior: Prior,
    root: Triple,
    curve: Curve,
) -> tuple[float, float]:
    """Climb by bracketed Gauss-Newton where the covariance is constant.

    Parameters
    ----------
    u, low, high : float
        Start and bracket, log range.
    first, second : float
        Readings in units of the read noise.
    prior, curve
        As for `log_density`.
    root : (float, float, float)
        Triangular root of the covariance of the readings.

    Returns
    -------
    (float, float)
        The mode and its scale.
    """
    curvature = 0.0
    moved = high - low
    for _ in range(60):
        value1, value2, slope1, slope2 = expected_at(u, prior, curve)
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
def climb(
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
    """Climb by bracketed Newton with differences: the covariance changes along the way.

    Parameters
    ----------
    u, low, high : float
        Start and bracket, log range.
    scale : float
        A first guess of the width of the peak.
    first, second, prior, spread, curve
        As for `log_density`.

    Returns
    -------
    (float, float)
        The mode and its scale.
    """
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
def edge(
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
    """Return where the density has fallen to nothing on the way from a mode to an end.

    Parameters
    ----------
    u, top : float
        The mode and its log density.
    end : float
        Where to stop at the latest, log range.
    scale : float
        Of the first step.
    first, second, prior, spread, curve
        As for `log_density`.
    """
    step = math.copysign(scale, end - u)
    at = u
    while abs(end - at) > abs(step):
        at += step
        if log_density(at, first, second, prior, spread, curve) < top - _DROP:
            return at
        step *= 1.5
    return end
