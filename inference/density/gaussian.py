"""The density of a frame's readings about their means, from which nothing cancels."""

import math

from simulator.compiled import compiled
from simulator.readings import noise_parts

__all__ = [
    "Pair",
    "covariance_slope",
    "gaussian",
    "log_top",
    "precision_times",
    "squared_cross",
]

Pair = tuple[float, float]

LOG_2PI = math.log(2 * math.pi)


@compiled
def gaussian(
    residual: Pair,
    mean: Pair,
    signal: Pair,
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
) -> float:
    """Return the log density of a residual, relative to the top of the read noise's density.

    With independent noise parts determinant and chi-square are sums of squares: a common relative
    error far above the read noise leaves the matrix near singular, but nothing cancels.
    """
    if shot is not None or relative is not None:
        unit = read[1]
        own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
        own1, own2, shared = own1 / unit / unit, own2 / unit / unit, shared / unit / unit
        s1, s2, e1, e2 = s1 / unit, s2 / unit, residual[0] / unit, residual[1] / unit
        determinant = _determinant(own1, own2, shared, s1, s2)
        turned = s2 * e1 - s1 * e2
        square = own2 * e1 * e1 + own1 * e2 * e2 + shared * (e1 - e2) ** 2 + turned * turned
        ratio = read[0] / unit
        return -0.5 * square / determinant - 0.5 * math.log(determinant / ratio / ratio)
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        e1 = residual[0] / read[0]
        e2 = residual[1] / read[1]
        return -0.5 * (e1 * e1 + e2 * e2)


@compiled
def log_top(read: Pair) -> float:
    """Return the log density of a zero residual under read noise alone."""
    return -math.log(read[0]) - math.log(read[1]) - LOG_2PI


@compiled
def _determinant(own1: float, own2: float, shared: float, s1: float, s2: float) -> float:
    """Return the determinant of diag(own1, own2) + shared [1 1; 1 1] + s s^T, a sum of squares."""
    return (
        own1 * own2
        + shared * (own1 + own2)
        + own2 * s1 * s1
        + own1 * s2 * s2
        + shared * (s1 - s2) ** 2
    )


@compiled
def precision_times(
    vector: Pair,
    mean: Pair,
    signal: Pair,
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
) -> Pair:
    """Return the inverse covariance times a vector."""
    if shot is not None or relative is not None:
        unit = read[1]
        own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
        own1, own2, shared = own1 / unit / unit, own2 / unit / unit, shared / unit / unit
        s1, s2, t1, t2 = s1 / unit, s2 / unit, vector[0] / unit, vector[1] / unit
        determinant = _determinant(own1, own2, shared, s1, s2)
        turned = s2 * t1 - s1 * t2
        return (
            (own2 * t1 + shared * (t1 - t2) + s2 * turned) / determinant / unit,
            (own1 * t2 + shared * (t2 - t1) - s1 * turned) / determinant / unit,
        )
    else:  # noqa: RET505
        return vector[0] / read[0] / read[0], vector[1] / read[1] / read[1]


@compiled
def squared_cross(
    first: Pair,
    second: Pair,
    mean: Pair,
    signal: Pair,
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
) -> float:
    """Return the squared cross product of two whitened vectors: of both readings, what is free."""
    unit = read[1]
    cross = (first[0] / unit) * (second[1] / unit) - (first[1] / unit) * (second[0] / unit)
    if shot is not None or relative is not None:
        own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
        own1, own2, shared = own1 / unit / unit, own2 / unit / unit, shared / unit / unit
        return cross * cross / _determinant(own1, own2, shared, s1 / unit, s2 / unit)
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        cross *= unit / read[0]
        return cross * cross


@compiled
def covariance_slope(
    pull: Pair,
    mean: Pair,
    mean_slope: Pair,
    signal: Pair,
    signal_slope: Pair,
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
) -> float:
    """Return what the change of the covariance adds to the slope of the log density.

    With w = V^-1 e it is (w^T V' w - tr(V^-1 V')) / 2, V' from the independent parts.
    """
    if shot is not None or relative is not None:
        own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
        d1, d2, dk, t1, t2 = 0.0, 0.0, 0.0, 0.0, 0.0
        if shot is not None:
            d1 = shot * mean_slope[0] * math.copysign(1.0, mean[0])
            d2 = shot * mean_slope[1] * math.copysign(1.0, mean[1])
            if pulsed:
                dk = d1 if abs(mean[0]) < abs(mean[1]) else d2
            d1, d2 = d1 - dk, d2 - dk
        if relative is not None:
            t1, t2 = relative * signal_slope[0], relative * signal_slope[1]
        unit = read[1]
        determinant = _determinant(
            own1 / unit / unit, own2 / unit / unit, shared / unit / unit, s1 / unit, s2 / unit
        )
        scale = determinant * unit * unit
        p11 = (own2 + shared + s2 * s2) / unit / unit / scale
        p22 = (own1 + shared + s1 * s1) / unit / unit / scale
        p12 = -(shared + s1 * s2) / unit / unit / scale
        w1, w2 = pull
        square = d1 * w1 * w1 + d2 * w2 * w2 + dk * (w1 + w2) ** 2
        square += 2.0 * (w1 * t1 + w2 * t2) * (w1 * s1 + w2 * s2)
        q1, q2 = precision_times((s1, s2), mean, signal, read, shot, relative, pulsed)
        trace = d1 * p11 + d2 * p22 + dk * (p11 + 2.0 * p12 + p22) + 2.0 * (t1 * q1 + t2 * q2)
        return 0.5 * (square - trace)
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 0.0
