"""Simulated frames of a sensor that follows its temperature."""

import numpy as np
from numpy.typing import NDArray

from simulator.at_temperature import delayed_light
from simulator.errors import InvalidInputError
from simulator.readings import light_that_errs, noise_parts
from simulator.sensor import Sensor
from simulator.temperature import temperature_problems
from simulator.terms import Terms
from simulator.trajectories import RadialTrajectory, SampledTrajectory

__all__ = ["temperatures", "warmed"]

Array = NDArray[np.float64]


def temperatures(sensor: Sensor, trajectory: RadialTrajectory | SampledTrajectory) -> Array | None:
    """Return the temperatures of a sensor that has coefficients [K], shape (n,), or None.

    Parameters
    ----------
    sensor, trajectory
        Of a simulation.

    Raises
    ------
    InvalidInputError
        At "/trajectory/temperature_k" where they are none of such a sensor.
    """
    given = trajectory.temperatures()
    if sensor.temperature is None:
        if given is not None:
            raise InvalidInputError.at(
                "/trajectory/temperature_k", "is given, and the sensor has no coefficients"
            )
        return None
    if given is None:
        return np.full(trajectory.ranges().size, sensor.temperature.reference_k)
    if problems := temperature_problems(sensor.temperature, given):
        raise InvalidInputError(*problems).below("/trajectory")
    return given


def warmed(
    sensor: Sensor, terms: Terms, moments: Array, light: Array, temperature_k: Array
) -> Array:
    """Return means and noise of frames at their temperatures, from those at the reference.

    Parameters
    ----------
    sensor : Sensor
        With numbers.
    terms : Terms
        The first parameter vector counts.
    moments : ndarray, shape (n, 7)
        Means, and parts of the noise, at the reference temperature.
    light : ndarray, shape (n, 2)
        The object's part of the means.
    temperature_k : ndarray, shape (n,)
        [K].

    Returns
    -------
    ndarray, shape (n, 7)
    """
    assert sensor.temperature is not None  # noqa: S101  # there are temperatures
    gain_drift, delay_drift = sensor.temperature.known
    warm = temperature_k - sensor.temperature.reference_k
    static = np.zeros(2) if terms.crosstalk is None else terms.crosstalk[0]
    factor = (1.0 + gain_drift * warm)[:, None]
    mean = static + factor * delayed_light(sensor, moments[:, :2] - static, delay_drift * warm)
    signal = factor * delayed_light(sensor, light, delay_drift * warm)
    noise = sensor.noise
    sizes = noise.read, noise.shot or None, noise.relative or None, sensor.kind == "pulsed"
    pairs = zip(map(tuple, mean.tolist()), map(tuple, signal.tolist()), strict=True)
    errs = ((m, light_that_errs(m, s, noise.flickers)) for m, s in pairs)
    parts = [noise_parts(*sizes, *pair) for pair in errs]
    return np.column_stack([mean, parts])
