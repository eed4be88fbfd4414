"""Light as a sensor reads it at a temperature, and frames as it would read them at another.

A sensor of temperature T has 1 + a (T - T0) times its gain, and light seems to come d (T - T0)
later (docs/model.md, sensor-temperature). Both act on the light of object and background. Crosstalk
is stated in reading units and does not follow the temperature.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor, shift_of

__all__ = ["at_reference", "delayed_light", "lag_rate", "readings_at_reference", "warmth"]

Array = NDArray[np.float64]
Pair = tuple[float, float]


def lag_rate(sensor: Sensor) -> float:
    """Return the sensor's lag per delay: a phase [rad/s], or of a pulse a length [m/s]."""
    if isinstance(sensor, PulsedSensor):
        return shift_of(1.0)
    return 2 * math.pi * sensor.frequency_hz


def warmth(sensor: Sensor, frames: Frames) -> Array | None:
    """Return by how much warmer than its reference a sensor was in each frame [K], shape (n,).

    nan where it is not known; None of a sensor, or of frames, without temperatures.
    """
    if sensor.temperature is None or frames.temperature_k is None:
        return None
    return np.asarray(frames.temperature_k - sensor.temperature.reference_k)


def delayed_light(sensor: Sensor, light: Array, delay_s: Array) -> Array:
    """Return the readings of light that comes later than it did.

    Exact while no light passes from wholly inside the pulse to wholly late; linear in the light.

    Parameters
    ----------
    light : ndarray, shape (n, 2, ...)
        Readings of light alone, without crosstalk.
    delay_s : ndarray, shape (n,)
        By how much later [s].

    Returns
    -------
    ndarray, of the shape of ``light``
    """
    lag = (delay_s * lag_rate(sensor)).reshape(-1, *[1] * (light.ndim - 2))
    first, second = light[:, 0], light[:, 1]
    if isinstance(sensor, PulsedSensor):
        return np.stack([first + second * (lag / sensor.r0), second], axis=1)
    cosine, sine = np.cos(lag), np.sin(lag)
    return np.stack([first * cosine - second * sine, first * sine + second * cosine], axis=1)


def readings_at_reference(
    sensor: Sensor, readings: Array, warm: Array, delay_drift: float, crosstalk: Pair | Array
) -> Array:
    """Return readings as they would be without the drift of the delay, shape (n, 2).

    Parameters
    ----------
    readings : ndarray, shape (n, 2)
        As read [reading units].
    warm : ndarray, shape (n,)
        From `warmth` [K].
    delay_drift : float
        [s/K].
    crosstalk : (float, float)
        What does not come with the light [reading units].
    """
    static = np.asarray(crosstalk)
    return static + delayed_light(sensor, readings - static, -delay_drift * warm)


def at_reference(
    sensor: Sensor, frames: Frames, crosstalk: Pair | Array = (0.0, 0.0)
) -> tuple[Sensor, Frames]:
    """Return a sensor without temperature coefficients, and frames as such a one reads them.

    The gain of a frame takes up what the sensor's gain has drifted, and its readings are turned
    back by what the delay has: means are exact. Noise stays as the sensor states it, which of a
    turned frame errs to first order in the turn. Saturated frames stay as they are.

    Parameters
    ----------
    sensor : Sensor
        Of a coefficient that is not known nothing is taken off.
    frames : Frames
        Checked.
    crosstalk : (float, float)
        In reading units; plays no part where the delay does not drift.

    Returns
    -------
    (Sensor, Frames)
        Of a sensor without coefficients both as they are. Frames of unknown temperature are as
        read: it is for the caller not to use them.
    """
    if sensor.temperature is None:
        return sensor, frames
    warm = warmth(sensor, frames)
    cold = sensor.model_copy(update={"temperature": None})
    if warm is None:
        return cold, frames
    warm = np.where(np.isfinite(warm), warm, 0.0)
    gain_drift, delay_drift = sensor.temperature.known
    gain, readings, derivatives = frames.gain, frames.readings, frames.derivatives
    if gain_drift != 0.0:
        gain = (1.0 + gain_drift * warm) * (1.0 if gain is None else gain)
    if delay_drift != 0.0:
        readings = readings_at_reference(sensor, readings, warm, delay_drift, crosstalk)
        beyond = frames.saturated(sensor)
        readings[beyond] = frames.readings[beyond]
        if derivatives is not None:
            derivatives = delayed_light(sensor, derivatives, -delay_drift * warm)
    return cold, dataclasses.replace(
        frames, readings=readings, derivatives=derivatives, gain=gain, temperature_k=None
    )
