"""Mean readings of a frame and their covariance, as kernels.

Arguments that are None are absent from the machine code: ``wave`` is None for a pulse (a sine wave
does not read ``r0``), ``background`` for a scene without one.
"""

import math
from collections.abc import Callable
from typing import Any

from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled, when_compiling
from simulator.object_model import log_slope, object_flux
from simulator.sensor import Reach

__all__ = [
    "background_readings",
    "background_slopes",
    "covariance",
    "late_rate",
    "late_share",
    "light_that_errs",
    "noise_parts",
    "object_readings",
    "object_slopes",
]

Pair = tuple[float, float]


def _share(r: float, r0: float) -> float:
    return min(r / r0, 1.0)


def _delayed_share(r: float, r0: Pair) -> float:
    return min(max((r + r0[1]) / r0[0], 0.0), 1.0)


def _rate(r: float, r0: float) -> float:
    return 1.0 / r0 if r < r0 else 0.0


def _delayed_rate(r: float, r0: Pair) -> float:
    return 1.0 / r0[0] if 0.0 < r + r0[1] < r0[0] else 0.0


def _slopes(flux: float, slope: float, r: float, r0: float) -> Pair:
    if r < r0:
        return flux * (slope + 1.0) * (r / r0), flux * slope
    return flux * slope, flux * slope


def _delayed_slopes(flux: float, slope: float, r: float, r0: Pair) -> Pair:
    share = (r + r0[1]) / r0[0]
    if 0.0 < share < 1.0:
        return flux * (slope * share + r / r0[0]), flux * slope
    if share > 0.0:
        return flux * slope, flux * slope
    return 0.0 * flux, flux * slope


def late_share(r: float, r0: Reach) -> float:
    """Return the share of an echo from r [m] that is late, min(r / r0, 1) (docs/model.md, 2.33).

    With a timing offset of length s, (r + s) / r0 within 0 and 1 (docs/model.md, sensor-unknowns).
    The machine code is chosen by the type of ``r0``: of sensors without one it has nothing of it.
    """
    return _delayed_share(r, r0) if isinstance(r0, tuple) else _share(r, r0)


def late_rate(r: float, r0: Reach) -> float:
    """Return how `late_share` changes with r [1/m]."""
    return _delayed_rate(r, r0) if isinstance(r0, tuple) else _rate(r, r0)


def _late_slopes(flux: float, slope: float, r: float, r0: Reach) -> Pair:
    """Return r d/dr of both windows of an echo; ``slope`` is that of the log of its flux."""
    if isinstance(r0, tuple):
        return _delayed_slopes(flux, slope, r, r0)
    return _slopes(flux, slope, r, r0)


@when_compiling
def _overload_pulses() -> None:
    from simulator.machine_code import is_number, overload

    @overload(late_share)
    def _of_share(r: Any, r0: Any) -> Callable[..., Any]:  # noqa: ARG001
        return _share if is_number(r0) else _delayed_share

    @overload(late_rate)
    def _of_rate(r: Any, r0: Any) -> Callable[..., Any]:  # noqa: ARG001
        return _rate if is_number(r0) else _delayed_rate

    @overload(_late_slopes)
    def _of_slopes(flux: Any, slope: Any, r: Any, r0: Any) -> Callable[..., Any]:  # noqa: ARG001
        return _slopes if is_number(r0) else _delayed_slopes


@compiled
def object_readings(
    r: float, r0: Reach, wave: Pair | None, strength: float, c0: float, c1: float
) -> Pair:
    """Return the object's mean readings (w1, w2) or (i, q), crosstalk not included.

    Parameters
    ----------
    r : float
        Range [m], positive.
    r0 : float or (float, float)
        c T_p / 2 of a pulse [m], and with it the length of a timing offset [m]: `late_share`.
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
    return flux * late_share(r, r0), flux


@compiled
def object_slopes(
    r: float, r0: Reach, wave: Pair | None, strength: float, c0: float, c1: float
) -> Pair:
    """Return r d/dr of `object_readings`, which is their derivative along log r."""
    flux = object_flux(r, strength, c0, c1)
    slope = log_slope(r, c0, c1)
    if wave is not None:
        phase = wave[0] * r + wave[1]
        cosine, sine, turn = math.cos(phase), math.sin(phase), wave[0] * r
        return flux * (slope * cosine - turn * sine), flux * (slope * sine + turn * cosine)
    return _late_slopes(flux, slope, r, r0)


@compiled
def background_readings(
    r: float,
    r0: Reach,
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
    return visible * late_share(distance, r0), visible


@compiled
def background_slopes(
    r: float,
    r0: Reach,
    wave: Pair | None,
    background: tuple[float, float, float, float],
) -> Pair:
    """Return r d/dr of `background_readings`."""
    strength, distance, c0, c1 = background
    change = strength * r * shadow_slope(r, c0, c1)
    if wave is not None:
        phase = wave[0] * distance + wave[1]
        return change * math.cos(phase), change * math.sin(phase)
    return change * late_share(distance, r0), change


@compiled
def light_that_errs(mean: Pair, signal: Pair, of_source: bool) -> Pair:
    """Return the light that has the common relative error of a frame.

    Parameters
    ----------
    mean : (float, float)
        Mean readings, everything included; or their slopes along an unknown.
    signal : (float, float)
        The object's part of them.
    of_source : bool
        Whether the error is the source's: then all of its light has it, crosstalk and background
        as the object's.
    """
    return mean if of_source else signal


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
        Standard deviation of a common relative error.
    pulsed : bool
        Whether the readings are windows of a pulse.
    mean : (float, float)
        Mean readings, everything included.
    signal : (float, float)
        What of them has the relative error (`light_that_errs`).

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
