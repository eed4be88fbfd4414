"""The light of a frame over many ranges at once, in the bits of the kernels' arithmetic.

For what the interpreter runs in the place of kernels (`simulator.by_arrays`). Functions of `math`
are taken of each number alone: numpy's own round otherwise.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FrameScene, Instrument
from inference.frame.noise import NoiseParts, determinant, in_units
from simulator.background import shadow, shadow_slope
from simulator.object_model import log_slope, object_flux
from simulator.readings import light_that_errs
from simulator.uncompiled import twin

__all__ = ["NotByArraysError", "gaussian", "information", "light", "of_each"]

Array = NDArray[np.float64]
Pairs = tuple[Array, Array]


class NotByArraysError(Exception):
    """The loop of the kernel has to do it."""


def of_each(function: Callable[[float], float], values: Array) -> Array:
    """Return a function of `math` of every value.

    Raises
    ------
    NotByArraysError
        Where Python refuses what the C library answers.
    """
    try:
        return np.array(list(map(function, values.tolist())))
    except (ValueError, OverflowError):
        raise NotByArraysError from None


def _noise(mean: Pairs, signal: Pairs, instrument: Instrument) -> NoiseParts:
    """Return `inference.frame.noise.noise_of` of arrays."""
    read, shot, relative = instrument.read, instrument.shot, instrument.relative
    own1: Any = read[0] * read[0]
    own2: Any = read[1] * read[1]
    shared: Any = 0.0
    if shot is not None:
        first, second = shot * abs(mean[0]), shot * abs(mean[1])
        if instrument.wave is None:
            shared = np.where(second < first, second, first)
        own1, own2 = own1 + (first - shared), own2 + (second - shared)
    rate: Any = relative
    errs = twin(light_that_errs)(mean, signal, instrument.of_source)
    common: Any = (0.0, 0.0) if rate is None else (rate * errs[0], rate * errs[1])
    return NoiseParts(own1, own2, shared, *common)


def gaussian(residual: Pairs, mean: Pairs, signal: Pairs, instrument: Instrument) -> Array:
    """Return `inference.frame.gaussian.gaussian` of arrays.

    Raises
    ------
    NotByArraysError
        Where the loop has to do it.
    """
    read = instrument.read
    if instrument.shot is None and instrument.relative is None:
        e1, e2 = residual[0] / read[0], residual[1] / read[1]
        return np.asarray(-0.5 * (e1 * e1 + e2 * e2))
    unit = read[1]
    noise = twin(in_units)(_noise(mean, signal, instrument), unit)
    e1, e2 = residual[0] / unit, residual[1] / unit
    area = twin(determinant)(noise)
    turned = noise.common2 * e1 - noise.common1 * e2
    square = noise.own2 * e1 * e1 + noise.own1 * e2 * e2
    square = square + noise.shared * ((e1 - e2) * (e1 - e2)) + turned * turned
    ratio = read[0] / unit
    logarithm = of_each(math.log, area / ratio / ratio)
    return np.asarray(-0.5 * square / area - 0.5 * logarithm)


def _shares(r: Any, instrument: Instrument) -> tuple[Any, Any]:
    """Return what of the light at a distance each reading has."""
    r0, wave = instrument.r0, instrument.wave
    if wave is not None:
        phase = wave[0] * np.atleast_1d(r) + wave[1]
        return of_each(math.cos, phase), of_each(math.sin, phase)
    if isinstance(r0, tuple):
        raise NotByArraysError
    return np.where(r / r0 > 1.0, 1.0, r / r0), 1.0


def light(r: Array, scene: FrameScene) -> tuple[Pairs, Pairs]:
    """Return `inference.frame.mean_readings.light_at` of all ranges, of a gain factor of 1.

    Parameters
    ----------
    r : ndarray, shape (n,)
        [m].

    Returns
    -------
    tuple of pairs of ndarray
        The object's readings, and all but crosstalk.

    Raises
    ------
    NotByArraysError
        Where the loop has to do it.
    """
    if scene.flux_error is not None:
        raise NotByArraysError
    flux = twin(object_flux)(r, *scene.shape)
    first, second = _shares(r, scene.instrument)
    signal = flux * first, flux * second
    if scene.background is None:
        return signal, signal
    strength, distance, c0, c1 = scene.background
    visible = strength * twin(shadow)(r, c0, c1)
    first, second = _shares(distance, scene.instrument)
    return signal, (signal[0] + visible * first, signal[1] + visible * second)


def information(r: Array, gain: float, scene: FrameScene) -> Array:
    """Return the Fisher information of a frame on its log r, as `inference.frame.table` has it.

    Parameters
    ----------
    r : ndarray, shape (n,)
        [m].
    gain : float
        The frame's factor.

    Raises
    ------
    NotByArraysError
        Where the loop has to do it.
    """
    shape, instrument = scene.shape, scene.instrument
    if scene.flux_error is not None or instrument.shot is not None:
        raise NotByArraysError
    flux = twin(object_flux)(r, *shape)
    slope = twin(log_slope)(r, shape.c0, shape.c1)
    first, second = _shares(r, instrument)
    if instrument.wave is not None:
        turn = instrument.wave[0] * r
        s1, s2 = flux * (slope * first - turn * second), flux * (slope * second + turn * first)
    else:
        near = flux * (slope + 1.0) * (r / instrument.r0)
        s1, s2 = np.where(r < instrument.r0, near, flux * slope), flux * slope
    if scene.background is not None:
        strength, distance, c0, c1 = scene.background
        change = strength * r * twin(shadow_slope)(r, c0, c1)
        first, second = _shares(distance, instrument)
        s1, s2 = s1 + change * first, s2 + change * second
    # as the table of all frames, from light of a gain factor of 1
    s1, s2, read = gain * s1, gain * s2, instrument.read
    return np.asarray(s1 * (s1 / read[0] / read[0]) + s2 * (s2 / read[1] / read[1]))
