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
    "noise_parts",
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
        c T_p / 2 of a pulse [m]; late is the share min(r / r0, 1) (docs/model.md, 2.33).
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
def noise_parts(
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
    mean: Pair,
    signal: Pair,
) -> tuple[float, float, float, float, float]:
    """Return independent parts of a frame's noise, from which nothing cancels.

    Parameters
    ----------
    read : (float, float)
        Standard deviations of the read noise.
    shot : float or None
        Variance per mean reading; of a pulse the late photons are part of the whole, so that the
        two windows share the variance of the smaller mean.
    relative : float or None
        Standard deviation of a common relative error of the object's signal.
    pulsed : bool
        Whether the readings are windows of a pulse.
    mean : (float, float)
        Mean readings, everything included.
    signal : (float, float)
        The object's part of them.

    Returns
    -------
    (float, float, float, float, float)
        Own variance of the first and of the second reading, shared variance, and standard
        deviations of the common relative error in both: the covariance matrix is
        diag(a1, a2) + k [1 1; 1 1] + s s^T.
    """
    own1, own2, shared = read[0] * read[0], read[1] * read[1], 0.0
    if shot is not None:
        first, second = shot * abs(mean[0]), shot * abs(mean[1])
        if pulsed:
            shared = min(first, second)
        own1 += first - shared
        own2 += second - shared
    if relative is not None:
        return own1, own2, shared, relative * signal[0], relative * signal[1]
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return own1, own2, shared, 0.0, 0.0


@compiled
def covariance(
    read: Pair,
    shot: float | None,
    relative: float | None,
    pulsed: bool,
    mean: Pair,
    signal: Pair,
) -> tuple[float, float, float]:
    """Return var(first), var(second) and cov(first, second); arguments as for `noise_parts`."""
    own1, own2, shared, s1, s2 = noise_parts(read, shot, relative, pulsed, mean, signal)
    return own1 + shared + s1 * s1, own2 + shared + s2 * s2, shared + s1 * s2
