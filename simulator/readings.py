"""Mean readings of a frame and their covariance, as kernels.

Arguments that are None are absent from the machine code: ``wave`` is None for a pulse (a sine wave
does not read ``r0``), ``background`` for a scene without one.
"""

import math

from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled
from simulator.object_model import log_slope, object_flux

__all__ = [
    "background_readings",
    "background_slopes",
    "covariance",
    "object_readings",
    "object_slopes",
]

Pair = tuple[float, float]


@compiled
def object_readings(
    r: float, r0: float, wave: Pair | None, strength: float, c0: float, c1: float
) -> Pair:
    """Return the object's mean readings (w1, w2) or (i, q), crosstalk not included.

    Parameters
    ----------
    r : float
        Range [m], positive.
    r0 : float
        c T_p / 2 of a pulse [m]; the late window holds the share min(r / r0, 1) (errata, 2.33).
    wave : (float, float) or None
        Wave number k [rad/m] and phase offset [rad] of a sine wave, None for a pulse.
    strength : float
        gain c0 c2 [reading units m^4].
    c0, c1 : float
        Object parameters [m^2], [m].
    """
    flux = object_flux(r, strength, c0, c1)
    if wave is not None:
        phase = wave[0] * r + wave[1]
        return flux * math.cos(phase), flux * math.sin(phase)
    return flux * min(r / r0, 1.0), flux


@compiled
def object_slopes(
    r: float, r0: float, wave: Pair | None, strength: float, c0: float, c1: float
) -> Pair:
    """Return r d/dr of `object_readings`, which is their derivative along log r."""
    flux = object_flux(r, strength, c0, c1)
    slope = log_slope(r, c0, c1)
    if wave is not None:
        phase = wave[0] * r + wave[1]
        cosine, sine, turn = math.cos(phase), math.sin(phase), wave[0] * r
        return flux * (slope * cosine - turn * sine), flux * (slope * sine + turn * cosine)
    if r < r0:
        return flux * (slope + 1.0) * (r / r0), flux * slope
    return flux * slope, flux * slope


@compiled
def background_readings(
    r: float,
    r0: float,
    wave: Pair | None,
    background: tuple[float, float, float, float],
) -> Pair:
    """Return the background's mean readings behind an object at range r.

    Parameters
    ----------
    r : float
        Range of the object [m]; inf where there is none.
    r0, wave
        As for `object_readings`.
    background : (float, float, float, float)
        Strength of the bare background [reading units], its distance R [m], shadow c0' [m^2] and
        c1' [m].
    """
    strength, distance, c0, c1 = background
    visible = strength * shadow(r, c0, c1) if math.isfinite(r) else strength
    if wave is not None:
        phase = wave[0] * distance + wave[1]
        return visible * math.cos(phase), visible * math.sin(phase)
    return visible * min(distance / r0, 1.0), visible


@compiled
def background_slopes(
    r: float,
    r0: float,
    wave: Pair | None,
    background: tuple[float, float, float, float],
) -> Pair:
    """Return r d/dr of `background_readings`."""
    strength, distance, c0, c1 = background
    change = strength * r * shadow_slope(r, c0, c1)
    if wave is not None:
        phase = wave[0] * distance + wave[1]
        return change * math.cos(phase), change * math.sin(phase)
    return change * min(distance / r0, 1.0), change


@compiled
def covariance(
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
    mean: Pair,
    signal: Pair,
) -> tuple[float, float, float]:
    """Return var(first), var(second) and cov(first, second) of a frame's readings.

    Parameters
    ----------
    read : (float, float)
        Standard deviations of the read noise.
    shot : float or None
        Variance per mean reading; of a pulse the late photons are part of the whole, so that the
        covariance is that of the smaller reading.
    relative : float or None
        Standard deviation of a common relative error of the object's signal.
    pulsed : bool
        Whether the readings are windows of a pulse.
    mean : (float, float)
        Mean readings, everything included.
    signal : (float, float)
        The object's part of them.
    """
    first, second, cross = read[0] * read[0], read[1] * read[1], 0.0
    if shot is not None:
        first += shot * abs(mean[0])
        second += shot * abs(mean[1])
        if pulsed:
            cross += shot * min(abs(mean[0]), abs(mean[1]))
    if relative is not None:
        share = relative * relative
        first += share * signal[0] * signal[0]
        second += share * signal[1] * signal[1]
        cross += share * signal[0] * signal[1]
    return first, second, cross
