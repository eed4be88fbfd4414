"""What is known of planned frames beside their readings: circuit, ruler's ranges, odometry."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from simulator.errors import InvalidInputError
from simulator.parameters import OFFSET, with_offset
from simulator.sensor import Sensor
from simulator.temperature import temperature_problems

__all__ = ["planned_circuit", "planned_rates", "with_rates"]

Array = NDArray[np.float64]

_WITHIN = 1.0  # standard deviations; at an end of its prior an offset has no slope, and seems known


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


def planned_rates(
    known: Sequence[float | None] | None, moved: Sequence[float | None] | None, log_r: Array
) -> Array | None:
    """Return one over the standard deviations to which ranges are to be known.

    Parameters
    ----------
    known, moved : sequence of float or None, optional
        Of range and displacement of each frame [m]; None where nothing is known.
    log_r : ndarray, shape (n,)
        nan for a frame without object, of which nothing is.

    Returns
    -------
    ndarray, shape (n, 2), or None
        As of `Experiment`; None where nothing is known of any frame.

    Raises
    ------
    InvalidInputError
        "/known_range_sd_m" or "/displacement_sd_m".
    """
    rates = np.zeros((log_r.size, 2))
    for k, (name, sds) in enumerate((("known_range_sd_m", known), ("displacement_sd_m", moved))):
        if sds is None:
            continue
        sd = np.array([math.inf if value is None else value for value in sds], dtype=float)
        if sd.size != log_r.size:
            message = f"has {sd.size} entries where ranges_m has {log_r.size}"
            raise InvalidInputError.at(f"/{name}", message)
        bad = np.flatnonzero(~(sd > 0))
        if bad.size:
            raise InvalidInputError.at(f"/{name}/{bad[0]}", "must be above 0, or null")
        rates[:, k] = np.where(np.isfinite(log_r), 1.0 / sd, 0.0)
    return rates if rates.any() else None


def with_rates(experiment: Experiment, rates: Array) -> Experiment:
    """Return the experiment with knowledge beside its readings, and the offset that this asks for.

    Parameters
    ----------
    rates : ndarray, shape (n, 2)
        As of `Experiment`.

    Raises
    ------
    InvalidInputError
        Where displacements leave no room for their offset: `simulator.parameters.with_offset`.
    """
    moved = rates[:, 1] > 0
    if OFFSET in experiment.parameters.names or not moved.any():
        return dataclasses.replace(experiment, rates=rates)
    ranges = np.exp(experiment.log_r[moved])
    parameters = with_offset(experiment.parameters, ranges - ranges.min())
    offset = parameters.unknowns[-1]
    ends = offset.from_normal(np.array([-_WITHIN, _WITHIN]), {})
    z = offset.to_normal(np.clip(ranges[[ranges.argmin()]], *ends), {})
    z = np.append(experiment.z, z)
    return dataclasses.replace(experiment, parameters=parameters, z=z, rates=rates)
