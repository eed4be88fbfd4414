"""What an error of the effective distance does to an object's readings."""

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Pair
from simulator.sensor import Reach, Sensor, instrument

__all__ = ["by_lag", "delayed"]

Array = NDArray[np.float64]


def delayed(light: Array, log_r: Array, r0: Reach, wave: Pair | None) -> Array:
    """Return the change of an object's readings with the distance that its light seems to come.

    Linear in the light, so that of its slopes or rates it is the change of these.

    Parameters
    ----------
    light : ndarray, shape (n, 2)
        The object's part of the readings; of a pulse w2 alone counts.
    log_r : ndarray, shape (n,)
        nan for a frame without object.
    r0, wave
        As in `inference.frame.arguments.Instrument`.

    Returns
    -------
    ndarray, shape (n, 2)
        In the unit of ``light`` per metre.
    """
    if wave is not None:
        return wave[0] * np.column_stack([-light[:, 1], light[:, 0]])
    # the late window holds no more than the whole pulse
    if isinstance(r0, tuple):
        r = np.exp(log_r) + r0[1]
        late = np.where((r > 0) & (r < r0[0]), light[:, 1] / r0[0], 0.0)
    else:
        late = np.where(log_r < np.log(r0), light[:, 1] / r0, 0.0)
    return np.column_stack([late, np.zeros(log_r.size)])


def by_lag(sensor: Sensor, light: Array, signal: Array, r: Array, distance: float) -> Array:
    """Return how readings change with the sensor's lag, per radian or per metre, shape (n, 2).

    Parameters
    ----------
    sensor : Sensor
        The sensor, with numbers.
    light, signal : ndarray, shape (n, 2)
        Of object and background together, and the object's part of it.
    r : ndarray, shape (n,)
        Ranges [m].
    distance : float
        Of the background [m].
    """
    r0, wave = instrument(sensor)
    if wave is not None:
        return np.column_stack([-light[:, 1], light[:, 0]])
    assert isinstance(r0, tuple)  # noqa: S101  # a lag comes with its r0
    late, behind = r + r0[1], distance + r0[1]
    of_object = np.where((late > 0) & (late < r0[0]), signal[:, 1], 0.0)
    of_rest = light[:, 1] - signal[:, 1] if 0 < behind < r0[0] else np.zeros(r.size)
    return np.column_stack([(of_object + of_rest) / r0[0], np.zeros(r.size)])
