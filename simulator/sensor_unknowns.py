"""What is unknown of a sensor: its gain, and by how much later than its path tells light seems.

The second, its *lag*, is a phase [rad] of a sine wave and a length [m] of a pulse. No sensor comes
calibrated, so that both may be priors, and so may be by how much they follow the temperature; what
the sensor states as numbers is no parameter.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from simulator.sensor import PulsedSensor, Sensor, shift_of
from simulator.terms import Terms
from simulator.unknowns import Unknown, Values, add_quantity

__all__ = [
    "DRIFTS",
    "GAIN",
    "PHASE",
    "TIMING",
    "add_sensor",
    "lag_path",
    "sensor_at",
    "sensor_terms",
    "with_numbers",
]

Array = NDArray[np.float64]

GAIN, PHASE, TIMING = "sensor.gain", "sensor.phase_offset_rad", "sensor.timing_offset_s"
DRIFTS = "sensor.temperature.gain_drift_per_k", "sensor.temperature.delay_drift_s_per_k"
"""Paths of a sensor's temperature coefficients, in the order of `Terms.drift`."""


def lag_path(sensor: Sensor) -> str:
    """Return the path of a sensor's lag."""
    return TIMING if isinstance(sensor, PulsedSensor) else PHASE


def add_sensor(sensor: Sensor, known: dict[str, float], unknowns: list[Unknown]) -> None:
    """Make unknowns of what a sensor states by priors.

    Parameters
    ----------
    known, unknowns : dict, list
        As of `simulator.unknowns.add_quantity`. What is known stays with the sensor.
    """
    for path in sensor.unknown:
        low = 0.0 if path == GAIN else -math.inf
        add_quantity(path, sensor.quantities[path], low, math.inf, known, unknowns)
    if sensor.temperature is not None:
        numbers = dict(zip(DRIFTS, sensor.temperature.known, strict=True))
        known |= {path: value for path, value in numbers.items() if path not in sensor.unknown}


def sensor_terms(values: Values) -> tuple[Array | None, Array | None, Array | None]:
    """Return gains [reading units m^2], lags [rad] or [m], each None where it is known, and drifts.

    Drifts, of shape (n, 2), are None of a sensor without temperature coefficients alone.
    """
    lag = values.get(PHASE)
    if TIMING in values:
        lag = shift_of(values[TIMING])
    drift = None
    if DRIFTS[0] in values:
        drift = np.column_stack([values[path] for path in DRIFTS])
    return values.get(GAIN), lag, drift


def with_numbers(sensor: Sensor, numbers: Mapping[str, float]) -> Sensor:
    """Return a sensor with numbers in place of what it states, by path; itself without any.

    Parameters
    ----------
    numbers : mapping of str to float
        Such as ``sensor.gain``; paths that are not the sensor's play no part.
    """
    changes: dict[str, object] = {
        path.removeprefix("sensor."): numbers[path]
        for path in sensor.quantities
        if path in numbers and path not in DRIFTS
    }
    drifts = {
        path.removeprefix("sensor.temperature."): numbers[path]
        for path in sensor.quantities
        if path in numbers and path in DRIFTS
    }
    if drifts and sensor.temperature is not None:
        changes["temperature"] = sensor.temperature.model_copy(update=drifts)
    return sensor.model_copy(update=changes) if changes else sensor


def sensor_at(sensor: Sensor, terms: Terms) -> Sensor:
    """Return a sensor with the numbers of the first parameter vector in place of its priors.

    Parameters
    ----------
    sensor : Sensor
        The sensor, itself where nothing of it is unknown.
    terms : Terms
        Physical values.
    """
    numbers: dict[str, float] = {}
    if terms.gain is not None:
        numbers[GAIN] = float(terms.gain[0])
    if terms.lag is not None:
        lag, path = float(terms.lag[0]), lag_path(sensor)
        numbers[path] = lag / shift_of(1.0) if path == TIMING else lag
    if terms.drift is not None:
        numbers |= dict(zip(DRIFTS, terms.drift[0].tolist(), strict=True))
    return with_numbers(sensor, numbers)
