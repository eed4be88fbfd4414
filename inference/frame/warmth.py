"""Frames of a sensor that follows its temperature: by how much warmer than its reference it was.

Kernels do not know of it: they are given frames as they would be at the reference.
"""

import numpy as np
from numpy.typing import NDArray

from inference.frame.blocks import GAIN, RANGE, WARM
from inference.frame.known_range import rates_of
from simulator.at_temperature import lag_rate
from simulator.sensor import Sensor, SineWaveSensor

__all__ = ["circuits", "gains_of", "slopes_of_drift", "with_warmth", "without_warmth"]

Array = NDArray[np.float64]


def with_warmth(frames: Array, warm: Array | None) -> Array:
    """Return frames, shape (n, 3 or 7), with the warmth of each [K], shape (n, 8).

    Where there is none they are as they are.
    """
    if warm is None:
        return frames
    rest = np.zeros((len(frames), WARM - frames.shape[1]))
    return np.ascontiguousarray(np.column_stack([frames, rest, warm]))


def without_warmth(frames: Array) -> Array:
    """Return frames as kernels take them: with what is known of ranges where something is."""
    if frames.shape[1] <= WARM:
        return frames
    width = RANGE if rates_of(frames) is None else WARM
    return np.ascontiguousarray(frames[:, :width])


def gains_of(frames: Array) -> Array:
    """Return the factor of each frame on the gain, and its warmth where it has one: (n[, 2])."""
    return frames[:, [GAIN, WARM] if frames.shape[1] > WARM else GAIN]


def circuits(n: int, gain: Array | None) -> tuple[Array, Array]:
    """Return factors on the gain and warmth [K] of n frames from `gains_of`, None for ones."""
    if gain is None:
        return np.ones(n), np.zeros(n)
    if gain.ndim == 2:
        return np.ascontiguousarray(gain[:, 0]), gain[:, 1]
    return np.ascontiguousarray(gain), np.zeros(n)


def slopes_of_drift(sensor: Sensor, drift: Array, warm: Array, light: Array) -> Array:
    """Return how readings change with the temperature coefficients, shape (n, 2, 2).

    Parameters
    ----------
    drift : ndarray, shape (2,)
        Of gain [1/K] and delay [s/K].
    warm : ndarray, shape (n,)
        [K].
    light : ndarray, shape (n, 2)
        All that is not crosstalk, as it is read at that temperature.
    """
    # light is linear in the lag of a pulse, and turns with that of a sine wave
    if isinstance(sensor, SineWaveSensor):
        by_lag = np.column_stack([-light[:, 1], light[:, 0]])
    else:
        by_lag = np.column_stack([light[:, 1] / sensor.r0, np.zeros(warm.size)])
    by_gain = light * (warm / (1.0 + drift[0] * warm))[:, None]
    return np.stack([by_gain, by_lag * (warm * lag_rate(sensor))[:, None]], axis=2)
