"""The density of a frame's readings about their means, from which nothing cancels.

Where there is neither shot nor relative noise the readings are independent, and the machine code
knows of nothing else.
"""

import math

from inference.frame.arguments import Instrument, Pair
from inference.frame.noise import NoiseParts, determinant, in_units, noise_of
from simulator.compiled import compiled
from simulator.readings import light_that_errs

__all__ = [
    "LOG_2PI",
    "covariance_slope",
    "empty_gaussian",
    "gaussian",
    "log_top",
    "precision_product",
    "precision_times",
    "squared_cross",
]

Triple = tuple[float, float, float]

LOG_2PI = math.log(2 * math.pi)


@compiled
def gaussian(residual: Pair, mean: Pair, signal: Pair, instrument: Instrument) -> float:
    """Return the log density of a residual, relative to the top of the read noise's density.

    With independent noise parts determinant and chi-square are sums of squares: a common relative
    error far above the read noise leaves the matrix near singular, but nothing cancels.
    """
    return _gaussian(residual, mean, signal, instrument, instrument.shot, instrument.relative)


@compiled
def empty_gaussian(residual: Pair, mean: Pair, instrument: Instrument) -> float:
    """Return `gaussian` of a frame without object, where a source may flicker, but no signal."""
    return gaussian(residual, mean, (0.0, 0.0), instrument)


@compiled
def _gaussian(
    residual: Pair,
    mean: Pair,
    signal: Pair,
    instrument: Instrument,
    shot: float | None,
    relative: float | None,
) -> float:
    read = instrument.read
    if shot is not None or relative is not None:
        unit = read[1]
        noise = in_units(noise_of(mean, signal, instrument), unit)
        e1, e2 = residual[0] / unit, residual[1] / unit
        area = determinant(noise)
        turned = noise.common2 * e1 - noise.common1 * e2
        square = noise.own2 * e1 * e1 + noise.own1 * e2 * e2
        square = square + noise.shared * ((e1 - e2) * (e1 - e2)) + turned * turned
        ratio = read[0] / unit
        return -0.5 * square / area - 0.5 * math.log(area / ratio / ratio)
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        e1 = residual[0] / read[0]
        e2 = residual[1] / read[1]
        return -0.5 * (e1 * e1 + e2 * e2)


@compiled
def log_top(read: Pair) -> float:
    """Return the log density of a zero residual under read noise alone."""
    return -math.log(read[0]) - math.log(read[1]) - LOG_2PI


@compiled
def precision_times(vector: Pair, mean: Pair, signal: Pair, instrument: Instrument) -> Pair:
    """Return the inverse covariance times a vector."""
    return _precision_times(vector, mean, signal, instrument, instrument.shot, instrument.relative)


@compiled
def _precision_times(
    vector: Pair,
    mean: Pair,
    signal: Pair,
    instrument: Instrument,
    shot: float | None,
    relative: float | None,
) -> Pair:
    read = instrument.read
    if shot is not None or relative is not None:
        unit = read[1]
        own1, own2, shared, s1, s2 = in_units(noise_of(mean, signal, instrument), unit)
        t1, t2 = vector[0] / unit, vector[1] / unit
        area = determinant(NoiseParts(own1, own2, shared, s1, s2))
        turned = s2 * t1 - s1 * t2
        return (
            (own2 * t1 + shared * (t1 - t2) + s2 * turned) / area / unit,
            (own1 * t2 + shared * (t2 - t1) - s1 * turned) / area / unit,
        )
    else:  # noqa: RET505
        return vector[0] / read[0] / read[0], vector[1] / read[1] / read[1]


@compiled
def precision_product(
    first: Pair, second: Pair, mean: Pair, signal: Pair, instrument: Instrument
) -> float:
    """Return first^T V^-1 second, V the covariance; nothing cancels, also not along the signal."""
    return _product(first, second, mean, signal, instrument, instrument.shot, instrument.relative)


@compiled
def _product(
    first: Pair,
    second: Pair,
    mean: Pair,
    signal: Pair,
    instrument: Instrument,
    shot: float | None,
    relative: float | None,
) -> float:
    read = instrument.read
    if shot is not None or relative is not None:
        unit = read[1]
        noise = in_units(noise_of(mean, signal, instrument), unit)
        own1, own2, shared, s1, s2 = noise
        a1, a2, b1, b2 = first[0] / unit, first[1] / unit, second[0] / unit, second[1] / unit
        total = own2 * a1 * b1 + own1 * a2 * b2 + shared * ((a1 - a2) * (b1 - b2))
        return (total + (s2 * a1 - s1 * a2) * (s2 * b1 - s1 * b2)) / determinant(noise)
    else:  # noqa: RET505
        return first[0] * (second[0] / read[0] / read[0]) + first[1] * (
            second[1] / read[1] / read[1]
        )


@compiled
def squared_cross(
    first: Pair, second: Pair, mean: Pair, signal: Pair, instrument: Instrument
) -> float:
    """Return the squared cross product of two whitened vectors: of both readings, what is free."""
    unit = instrument.read[1]
    cross = (first[0] / unit) * (second[1] / unit) - (first[1] / unit) * (second[0] / unit)
    return _squared(cross, mean, signal, instrument, instrument.shot, instrument.relative)


@compiled
def _squared(
    cross: float,
    mean: Pair,
    signal: Pair,
    instrument: Instrument,
    shot: float | None,
    relative: float | None,
) -> float:
    read = instrument.read
    if shot is not None or relative is not None:
        return cross * cross / determinant(in_units(noise_of(mean, signal, instrument), read[1]))
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        cross *= read[1] / read[0]
        return cross * cross


@compiled
def _shot_slopes(mean: Pair, mean_slope: Pair, shot: float | None, pulsed: bool) -> Triple:
    """Return the slopes of both own variances and of the shared one."""
    if shot is not None:
        d1 = shot * mean_slope[0] * math.copysign(1.0, mean[0])
        d2 = shot * mean_slope[1] * math.copysign(1.0, mean[1])
        shared = 0.0
        if pulsed:
            shared = d1 if abs(mean[0]) < abs(mean[1]) else d2
        return d1 - shared, d2 - shared, shared
    else:  # noqa: RET505
        return 0.0, 0.0, 0.0


@compiled
def _common_slopes(slope: Pair, relative: float | None) -> Pair:
    """Return the slopes of the common error's standard deviations."""
    if relative is not None:
        return relative * slope[0], relative * slope[1]
    else:  # noqa: RET505
        return 0.0, 0.0


@compiled
def covariance_slope(
    residual: Pair,
    mean: Pair,
    mean_slope: Pair,
    signal: Pair,
    signal_slope: Pair,
    instrument: Instrument,
) -> float:
    """Return what the change of the covariance adds to the slope of the log density.

    With w = V^-1 e it is (w^T V' w - tr(V^-1 V')) / 2, V' from the independent parts.
    """
    pulsed = instrument.wave is None
    own = _shot_slopes(mean, mean_slope, instrument.shot, pulsed)
    errs = light_that_errs(mean_slope, signal_slope, instrument.of_source)
    common = _common_slopes(errs, instrument.relative)
    return _covariance_slope(
        residual, mean, signal, own, common, instrument, instrument.shot, instrument.relative
    )


@compiled
def _covariance_slope(
    residual: Pair,
    mean: Pair,
    signal: Pair,
    own_slopes: Triple,
    common_slopes: Pair,
    instrument: Instrument,
    shot: float | None,
    relative: float | None,
) -> float:
    if shot is not None or relative is not None:
        unit = instrument.read[1]
        noise = in_units(noise_of(mean, signal, instrument), unit)
        own1, own2, shared, s1, s2 = noise
        e1, e2 = residual[0] / unit, residual[1] / unit
        d1, d2, dk = own_slopes
        t1, t2 = common_slopes[0] / unit, common_slopes[1] / unit
        area = determinant(noise)
        turned = (s2 * e1 - s1 * e2) / area
        w1 = (own2 * e1 + shared * (e1 - e2)) / area + s2 * turned
        w2 = (own1 * e2 + shared * (e2 - e1)) / area - s1 * turned
        both = (own2 * e1 + own1 * e2) / area + (s2 - s1) * turned  # w1 + w2
        # of w and V^-1 s along s what is large cancels exactly, and is not formed
        along = (own2 * e1 * s1 + own1 * e2 * s2 + shared * (e1 - e2) * (s1 - s2)) / area
        across = (own2 * e1 * t1 + own1 * e2 * t2 + shared * (e1 - e2) * (t1 - t2)) / area
        across += turned * (s2 * t1 - s1 * t2)
        common = (own2 * s1 * t1 + own1 * s2 * t2 + shared * (s1 - s2) * (t1 - t2)) / area
        square = d1 / unit / unit * (w1 * w1 - (own2 + shared + s2 * s2) / area)
        square += d2 / unit / unit * (w2 * w2 - (own1 + shared + s1 * s1) / area)
        square += dk / unit / unit * (both * both - (own1 + own2 + (s1 - s2) * (s1 - s2)) / area)
        return 0.5 * square + along * across - common
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return 0.0
