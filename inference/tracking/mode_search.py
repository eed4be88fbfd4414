"""One mode of a frame's density along the range: its top, and where it ends."""

import math
from typing import NamedTuple

from inference.tracking.borrowed import borrowed
from inference.tracking.frame_density import Prior, TrackedFrame, expected_at, log_density
from inference.tracking.readings_table import ReadingsTable
from inference.tracking.roots import Root
from simulator.compiled import compiled

__all__ = ["ModeBracket", "edge", "mode_by_differences", "mode_of_plain"]

_CLOSE = 0.05  # standard deviations within which a mode has to be found
_DROP = 18.0  # nats below the top where a numerical integral ends


class ModeBracket(NamedTuple):
    """Where to look for a mode: a start, and an interval that holds it; log range."""

    start: float
    low: float
    high: float


@borrowed
@compiled
def mode_of_plain(
    bracket: ModeBracket, frame: TrackedFrame, prior: Prior, root: Root, table: ReadingsTable
) -> tuple[float, float]:
    """Find a mode by bracketed Gauss-Newton where the covariance is constant.

    Parameters
    ----------
    bracket : ModeBracket
        Where to look.
    frame, prior, table
        As for `log_density`.
    root : Root
        Of the covariance of the readings.

    Returns
    -------
    (float, float)
        The mode and its scale.
    """
    position, added, gain = prior.position, prior.added, frame.gain
    u, low, high = bracket
    curvature = 0.0
    moved = high - low
    for _ in range(60):
        value1, value2, slope1, slope2 = expected_at(u, prior, table)
        away = 0.0 if position.born else u - position.centre
        e1 = frame.first - gain * value1 - added.offset1 - added.slope1 * away
        e2 = frame.second - gain * value2 - added.offset2 - added.slope2 * away
        t1 = (gain * slope1 + added.slope1) / root.r11
        t2 = (gain * slope2 + added.slope2 - root.r21 * t1) / root.r22
        z1 = e1 / root.r11
        z2 = (e2 - root.r21 * z1) / root.r22
        precision = 0.0 if position.born else position.precision
        slope = t1 * z1 + t2 * z2 - away * precision
        curvature = t1 * t1 + t2 * t2 + precision
        if frame.known_rate > 0.0:
            along = math.exp(u) * frame.known_rate
            slope += (frame.known_m * frame.known_rate - along) * along
            curvature += along * along
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


@borrowed
@compiled
def mode_by_differences(
    bracket: ModeBracket, scale: float, frame: TrackedFrame, prior: Prior, table: ReadingsTable
) -> tuple[float, float]:
    """Find a mode by bracketed Newton with differences: the covariance changes along the way.

    Parameters
    ----------
    bracket : ModeBracket
        Where to look.
    scale : float
        A first guess of the width of the mode.
    frame, prior, table
        As for `log_density`.

    Returns
    -------
    (float, float)
        The mode and its scale.
    """
    u, low, high = bracket
    moved, width = high - low, high - low
    h = 0.3 * scale
    for _ in range(60):
        middle = log_density(u, frame, prior, table)
        right = log_density(u + h, frame, prior, table)
        left = log_density(u - h, frame, prior, table)
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
            # steps of the differences and of the mode must be alike before either is believed
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


@borrowed
@compiled
def edge(
    u: float,
    top: float,
    end: float,
    scale: float,
    frame: TrackedFrame,
    prior: Prior,
    table: ReadingsTable,
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
    frame, prior, table
        As for `log_density`.
    """
    step = math.copysign(scale, end - u)
    at = u
    while abs(end - at) > abs(step):
        at += step
        if log_density(at, frame, prior, table) < top - _DROP:
            return at
        step *= 1.5
    return end
