"""The density of one frame along its range: what the collapsed likelihood integrates."""

import math

from inference.density.gaussian import Pair, covariance_slope, gaussian, precision_times
from inference.density.warp import Curve, curve_at
from simulator.compiled import compiled
from simulator.readings import (
    background_readings,
    background_slopes,
    object_readings,
    object_slopes,
)

__all__ = [
    "Law",
    "Quad",
    "ReferenceLaw",
    "SceneArguments",
    "Triple",
    "WarpedArguments",
    "log_integrand",
    "log_range_density",
    "log_resolution",
    "range_slope",
    "readings_along",
    "slope_and_curvature",
]

Triple = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Law = tuple[float, float, float, float, float, float, float, float]
# with a ninth entry, the ranges have their reference prior: the length is known at compile time
ReferenceLaw = tuple[float, float, float, float, float, float, float, float, float]
# shape, crosstalk, background, law of the range, r0, wave, read, shot, relative, error of the flux:
# what the kernels know of a scene and its sensor; what is None does not exist in the machine code
SceneArguments = tuple[
    Triple,
    Pair | None,
    Quad | None,
    Law | ReferenceLaw,
    float,
    Pair | None,
    Pair,
    float | None,
    float | None,
    Curve | None,
]
# the same where the flux does have an error
WarpedArguments = tuple[
    Triple,
    Pair | None,
    Quad | None,
    Law | ReferenceLaw,
    float,
    Pair | None,
    Pair,
    float | None,
    float | None,
    Curve,
]

_DIFFERENCE = 1e-3  # in log r, over which the resolution changes slowly


@compiled
def log_range_density(r: float, u: float, law: Law | ReferenceLaw) -> float:
    """Return the log prior density of u = log r (`simulator.parameters.Terms.ranges`)."""
    linear = (r - law[2]) * law[3]
    logarithmic = (u - law[4]) * law[5]
    return law[0] + (law[1] + 1.0) * u - 0.5 * (linear * linear + logarithmic * logarithmic)


@compiled
def range_slope(r: float, u: float, law: Law | ReferenceLaw) -> float:
    """Return the derivative of `log_range_density` along u."""
    return law[1] + 1.0 - r * (r - law[2]) * law[3] * law[3] - (u - law[4]) * law[5] * law[5]


@compiled
def readings_along(
    u: float,
    gain: float,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    r0: float,
    wave: Pair | None,
    delta: Curve | None,
) -> tuple[Pair, Pair, Pair, Pair]:
    """Return mean readings and their slopes along log r.

    Parameters
    ----------
    u, shape, crosstalk, background, r0, wave, delta
        As for `log_integrand`.
    gain : float
        The frame's gain factor.

    Returns
    -------
    tuple of four (float, float)
        The object's readings and slopes, then those of everything.
    """
    r = math.exp(u)
    strength, warp = gain * shape[0], 0.0
    if delta is not None:
        value, warp = curve_at(u, delta)
        strength *= math.exp(value)
    o1, o2 = object_readings(r, r0, wave, strength, shape[1], shape[2])
    s1, s2 = object_slopes(r, r0, wave, strength, shape[1], shape[2])
    if delta is not None:
        s1, s2 = s1 + warp * o1, s2 + warp * o2
    m1, m2, t1, t2 = o1, o2, s1, s2
    if background is not None:
        b1, b2 = background_readings(r, r0, wave, background)
        a1, a2 = background_slopes(r, r0, wave, background)
        m1, m2 = m1 + gain * b1, m2 + gain * b2
        t1, t2 = t1 + gain * a1, t2 + gain * a2
    if crosstalk is not None:
        m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
    return (o1, o2), (s1, s2), (m1, m2), (t1, t2)


@compiled
def log_resolution(
    u: float,
    gain: float,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    delta: Curve | None,
) -> float:
    """Return log sqrt(1 + I), I the Fisher information of a frame on its log r.

    It is the density of the reference prior where the readings tell ranges apart, and that of a
    log-uniform one where they do not.
    """
    signal, _, mean, slope = readings_along(u, gain, shape, crosstalk, background, r0, wave, delta)
    p1, p2 = precision_times(slope, mean, signal, read, shot, relative, wave is None)
    return 0.5 * math.log1p(max(slope[0] * p1 + slope[1] * p2, 0.0))


@compiled
def log_integrand(
    u: float,
    frame: Triple,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    law: Law | ReferenceLaw,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    delta: Curve | None = None,
) -> float:
    """Return log p(y, u | theta) less `log_top`.

    Parameters
    ----------
    u : float
        log r.
    frame : (float, float, float)
        The two readings and the frame's gain factor.
    shape : (float, float, float)
        gain c0 c2, c0, c1.
    crosstalk, background
        As in `simulator.parameters.Terms`, None where the scene has none.
    law : tuple
        Prior of the range.
    r0, wave, read, shot, relative
        The sensor, as for `simulator.readings`.
    delta : Curve, optional
        Logarithm of the factor by which the object's flux differs from the model's.
    """
    r = math.exp(u)
    gain = frame[2]
    strength = gain * shape[0]
    if delta is not None:
        strength *= math.exp(curve_at(u, delta)[0])
    o1, o2 = object_readings(r, r0, wave, strength, shape[1], shape[2])
    m1, m2 = o1, o2
    if background is not None:
        b1, b2 = background_readings(r, r0, wave, background)
        m1, m2 = m1 + gain * b1, m2 + gain * b2
    if crosstalk is not None:
        m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
    e1, e2 = frame[0] - m1, frame[1] - m2
    pulsed = wave is None
    density = gaussian((e1, e2), (m1, m2), (o1, o2), read, shot, relative, pulsed)
    density += log_range_density(r, u, law)
    if len(law) == 9:  # decided at compile time
        density += log_resolution(
            u, gain, shape, crosstalk, background, r0, wave, read, shot, relative, delta
        )
    return density


@compiled
def slope_and_curvature(
    u: float,
    frame: Triple,
    shape: Triple,
    crosstalk: Pair | None,
    background: Quad | None,
    law: Law | ReferenceLaw,
    r0: float,
    wave: Pair | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    delta: Curve | None = None,
) -> Pair:
    """Return the slope of `log_integrand` along u and its Gauss-Newton curvature, never negative.

    The curvature holds the covariance fixed.
    """
    r = math.exp(u)
    pulsed = wave is None
    signal, signal_slope, mean, slope = readings_along(
        u, frame[2], shape, crosstalk, background, r0, wave, delta
    )
    e1, e2 = frame[0] - mean[0], frame[1] - mean[1]
    p1, p2 = precision_times(slope, mean, signal, read, shot, relative, pulsed)
    pull = precision_times((e1, e2), mean, signal, read, shot, relative, pulsed)
    rise = e1 * p1 + e2 * p2 + range_slope(r, u, law)
    rise += covariance_slope(pull, mean, slope, signal, signal_slope, read, shot, relative, pulsed)
    if len(law) == 9:  # decided at compile time
        rest = (frame[2], shape, crosstalk, background, r0, wave, read, shot, relative, delta)
        ahead = log_resolution(u + _DIFFERENCE, *rest)
        rise += (ahead - log_resolution(u - _DIFFERENCE, *rest)) / (2 * _DIFFERENCE)
    bend = slope[0] * p1 + slope[1] * p2 + law[5] * law[5] + r * r * law[3] * law[3]
    return rise, bend
