"""Gains and temperatures of frames before they are taken."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from simulator.errors import InvalidInputError
from simulator.sensor import Sensor
from simulator.temperature import temperature_problems

__all__ = ["planned_circuit"]

Array = NDArray[np.float64]


def planned_circuit(
    sensor: Sensor, n: int, gain: Sequence[float] | None, temperature_k: Sequence[float] | None
) -> Array | None:
    """Return the gains of frames, and where it follows its temperature the sensor's warmth.

    Parameters
    ----------
    sensor, gain, temperature_k
        As of `inference.identifiability.before_data.identifiability`.
    n : int
        Number of frames.

    Returns
    -------
    ndarray, shape (n,) or (n, 2), or None
        As `inference.identifiability.experiment.Experiment.gain`.

    Raises
    ------
    InvalidInputError
        At "/temperature_k".
    """
    gains = None if gain is None else np.asarray(gain, dtype=float)
    if temperature_k is None:
        return gains
    temperature, pointer = np.asarray(temperature_k, dtype=float), "/temperature_k"
    if sensor.temperature is None:
        raise InvalidInputError.at(pointer, "is given, and the sensor has no coefficients")
    if temperature.size != n:
        message = f"has {temperature.size} entries where ranges_m has {n}"
        raise InvalidInputError.at(pointer, message)
    if problems := temperature_problems(sensor.temperature, temperature):
        raise InvalidInputError(*problems)
    warm = temperature - sensor.temperature.reference_k
    return np.column_stack([np.ones(n) if gains is None else gains, warm])
