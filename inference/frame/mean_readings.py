"""Mean readings of a frame along its range."""

import math
from typing import NamedTuple

from inference.frame.arguments import (
    Background,
    FluxError,
    FrameScene,
    Instrument,
    Pair,
    Shape,
)
from inference.frame.flux_error import flux_error_at
from simulator.compiled import compiled
from simulator.readings import (
    background_readings,
    background_slopes,
    object_readings,
    object_slopes,
)

__all__ = [
    "Along",
    "Means",
    "light_along",
    "light_at",
    "readings_along",
    "readings_at",
    "with_crosstalk",
    "with_surroundings",
]


class Means(NamedTuple):
    """Mean readings [reading units].

    Attributes
    ----------
    signal : (float, float)
        The object's part.
    mean : (float, float)
        Everything.
    """

    signal: Pair
    mean: Pair


class Along(NamedTuple):
    """Mean readings and their slopes along log r [reading units].

    Attributes
    ----------
    signal, signal_slope : (float, float)
        The object's part.
    mean, slope : (float, float)
        Everything.
    """

    signal: Pair
    signal_slope: Pair
    mean: Pair
    slope: Pair


@compiled
def _strength(u: float, strength: float, flux_error: FluxError | None) -> float:
    """Return the object's strength with its flux's error."""
    if flux_error is not None:
        return strength * math.exp(flux_error_at(u, flux_error)[0])
    else:  # noqa: RET505  # a branch, so that it is pruned at compile time
        return strength


@compiled
def _with_background(
    mean: Pair, r: float, gain: float, background: Background | None, instrument: Instrument
) -> Pair:
    """Add the background's mean readings."""
    if background is not None:
        b1, b2 = background_readings(r, instrument.r0, instrument.wave, background)
        return mean[0] + gain * b1, mean[1] + gain * b2
    else:  # noqa: RET505
        return mean


@compiled
def _with_crosstalk(mean: Pair, crosstalk: Pair | None) -> Pair:
    """Add crosstalk."""
    if crosstalk is not None:
        return mean[0] + crosstalk[0], mean[1] + crosstalk[1]
    else:  # noqa: RET505
        return mean


@compiled
def light_at(u: float, r: float, gain: float, scene: FrameScene) -> Means:
    """Return mean readings without crosstalk at u = log r; ``gain`` is the frame's factor."""
    shape, instrument = scene.shape, scene.instrument
    strength = _strength(u, gain * shape.strength, scene.flux_error)
    signal = object_readings(r, instrument.r0, instrument.wave, strength, shape.c0, shape.c1)
    return Means(signal, _with_background(signal, r, gain, scene.background, instrument))


@compiled
def with_surroundings(signal: Pair, r: float, gain: float, scene: FrameScene) -> Pair:
    """Add background and crosstalk to the readings of an object at r [m], inf where there is none.

    ``gain`` is the frame's gain factor.
    """
    mean = _with_background(signal, r, gain, scene.background, scene.instrument)
    return _with_crosstalk(mean, scene.crosstalk)


@compiled
def readings_at(u: float, r: float, gain: float, scene: FrameScene) -> Means:
    """Return mean readings at u = log r; ``gain`` is the frame's gain factor."""
    signal, mean = light_at(u, r, gain, scene)
    return Means(signal, _with_crosstalk(mean, scene.crosstalk))


@compiled
def _object_along(
    u: float,
    r: float,
    gain: float,
    shape: Shape,
    instrument: Instrument,
    flux_error: FluxError | None,
) -> tuple[Pair, Pair]:
    """Return the object's mean readings and their slopes."""
    r0, wave = instrument.r0, instrument.wave
    strength, change = gain * shape.strength, 0.0
    if flux_error is not None:
        value, change = flux_error_at(u, flux_error)
        strength *= math.exp(value)
    o1, o2 = object_readings(r, r0, wave, strength, shape.c0, shape.c1)
    s1, s2 = object_slopes(r, r0, wave, strength, shape.c0, shape.c1)
    if flux_error is not None:
        s1, s2 = s1 + change * o1, s2 + change * o2
    return (o1, o2), (s1, s2)


@compiled
def _background_along(
    slope: Pair, r: float, gain: float, background: Background | None, instrument: Instrument
) -> Pair:
    """Add the background's slopes."""
    if background is not None:
        a1, a2 = background_slopes(r, instrument.r0, instrument.wave, background)
        return slope[0] + gain * a1, slope[1] + gain * a2
    else:  # noqa: RET505
        return slope


@compiled
def light_along(u: float, r: float, gain: float, scene: FrameScene) -> Along:
    """Return mean readings without crosstalk, and slopes, at u = log r."""
    instrument, background = scene.instrument, scene.background
    signal, signal_slope = _object_along(u, r, gain, scene.shape, instrument, scene.flux_error)
    mean = _with_background(signal, r, gain, background, instrument)
    slope = _background_along(signal_slope, r, gain, background, instrument)
    return Along(signal, signal_slope, mean, slope)


@compiled
def with_crosstalk(mean: Pair, gain: float, scene: FrameScene) -> Pair:
    """Return mean readings at a gain factor, crosstalk among them, from light at a factor of 1."""
    return _with_crosstalk((gain * mean[0], gain * mean[1]), scene.crosstalk)


@compiled
def readings_along(u: float, r: float, gain: float, scene: FrameScene) -> Along:
    """Return mean readings and slopes at u = log r; ``gain`` is the frame's gain factor."""
    signal, signal_slope, mean, slope = light_along(u, r, gain, scene)
    return Along(signal, signal_slope, _with_crosstalk(mean, scene.crosstalk), slope)
