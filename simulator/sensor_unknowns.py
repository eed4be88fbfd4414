"""What is unknown of a sensor: its gain, and by how much later than its path tells light seems.

The second, its *lag*, is a phase [rad] of a sine wave and a length [m] of a pulse. No sensor comes
calibrated, so that both may be priors; what the sensor states as numbers is no parameter.
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.sensor import PulsedSensor, Sensor, shift_of
from simulator.terms import Terms
from simulator.unknowns import Unknown, Values, add_quantity

__all__ = ["GAIN", "PHASE", "TIMING", "add_sensor", "lag_path", "sensor_at", "sensor_terms"]

Array = NDArray[np.float64]

GAIN, PHASE, TIMING = "sensor.gain", "sensor.phase_offset_rad", "sensor.timing_offset_s"


def lag_path(sensor: Sensor) -> str:
    """Return the path of a sensor's lag."""
    return TIMING if isinstance(sensor, PulsedSensor) else PHASE


def add_sensor(sensor: Sensor, known: dict[str, float], unknowns: list[Unknown]) -> None:
    """Make unknowns of what a sensor states by priors.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    known, unknowns : dict, list
        As of `simulator.unknowns.add_quantity`. What is known stays with the sensor.
    """
    for path in sensor.unknown:
        low = 0.0 if path == GAIN else -math.inf
        add_quantity(path, sensor.quantities[path], low, math.inf, known, unknowns)


def sensor_terms(values: Values) -> tuple[Array | None, Array | None]:
    """Return gains [reading units m^2] and lags [rad] or [m], each None where it is known."""
    lag = values.get(PHASE)
    if TIMING in values:
        lag = shift_of(values[TIMING])
    return values.get(GAIN), lag


def sensor_at(sensor: Sensor, terms: Terms) -> Sensor:
    """Return a sensor with the numbers of the first parameter vector in place of its priors.

    Parameters
    ----------
    sensor : Sensor
        The sensor, itself where nothing of it is unknown.
    terms : Terms
        Physical values.
    """
    changes: dict[str, float] = {}
    if terms.gain is not None:
        changes["gain"] = float(terms.gain[0])
    if terms.lag is not None:
        lag, path = float(terms.lag[0]), lag_path(sensor)
        value = lag / shift_of(1.0) if path == TIMING else lag
        changes[path.removeprefix("sensor.")] = value
    return sensor.model_copy(update=changes) if changes else sensor
