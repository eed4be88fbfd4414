"""Mean readings of a frame and their analytic derivatives along everything that may be unknown.

The information can lie eight orders of magnitude below the largest derivative, where finite
differences leave nothing. The kernel `fill_slopes` differentiates one frame along the physical
values; `sensitivity` does so for all frames along coordinates without units
(`inference.frame.coordinates`).
"""

import dataclasses
import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import Instrument, instrument_of
from inference.frame.delayed import by_lag
from inference.frame.noise import whiteners as whiteners_at
from inference.frame.warmth import circuits, slopes_of_drift
from simulator.at_temperature import delayed_light
from simulator.background import shadow
from simulator.compiled import compiled
from simulator.object_model import quadratic
from simulator.parameters import Terms
from simulator.readings import (
    background_readings,
    background_slopes,
    late_rate,
    object_readings,
    object_slopes,
)
from simulator.sensor import Reach, Sensor
from simulator.sensor_unknowns import sensor_at

__all__ = [
    "SLOPES",
    "Sensitivity",
    "Value",
    "fill_slopes",
    "sensitivity",
    "whiteners",
]

Array = NDArray[np.float64]


class Value(IntEnum):
    """The physical values on which a frame's readings depend, and the readings themselves.

    Rows of what `fill_slopes` fills; up to `LOG_RANGE`, entries of the values that it takes.
    """

    C0 = 0  # [m^2]
    C1 = 1  # [m]
    C2 = 2
    CROSSTALK_1 = 3  # [reading units]
    CROSSTALK_2 = 4
    STRENGTH = 5  # of the background [reading units]
    DISTANCE = 6  # of the background [m]
    SHADOW_C0 = 7  # [m^2]
    SHADOW_C1 = 8  # [m]
    LOG_RANGE = 9
    READINGS = 10


SLOPES = len(Value)
"""Rows of what `fill_slopes` fills."""


@compiled
def fill_slopes(
    out: Array,
    u: float,
    values: Array,
    gain: float,
    factor: float,
    background: bool | None,
    instrument: Instrument,
) -> None:
    """Fill mean readings of a frame and their derivatives.

    Parameters
    ----------
    out : ndarray, shape (SLOPES, 4)
        Rows: derivatives along each `Value`, and last the readings themselves. Columns: both
        readings, then the object's part of both.
    u : float
        log r; nan where there is no object.
    values : ndarray, shape (at least 9,)
        Physical values in the order of `Value`. Members of the background are not read where there
        is none.
    gain : float
        The sensor's gain, times by what the object's flux differs from the model's [reading units].
    factor : float
        The frame's factor on the light of object and background.
    background : bool or None
        None where the scene has no background.
    instrument : Instrument
        The sensor.
    """
    r0, wave = instrument.r0, instrument.wave
    out[:] = 0.0
    r = math.inf
    if math.isfinite(u):
        r = math.exp(u)
        c0, c1 = values[Value.C0], values[Value.C1]
        each = gain * factor * c0  # for c2 = 1
        strength = each * values[Value.C2]
        o1, o2 = object_readings(r, r0, wave, strength, c0, c1)
        s1, s2 = object_slopes(r, r0, wave, strength, c0, c1)
        a1, a2 = object_readings(r, r0, wave, each, c0, c1)
        q = quadratic(r, c0, c1)
        # d log(c0 / Q) / dc0 without cancellation
        along0, along1 = r * (r + c1) / c0 / q, -r / q
        for column in (0, 2):
            out[Value.C0, column], out[Value.C0, column + 1] = o1 * along0, o2 * along0
            out[Value.C1, column], out[Value.C1, column + 1] = o1 * along1, o2 * along1
            out[Value.C2, column], out[Value.C2, column + 1] = a1, a2
            out[Value.LOG_RANGE, column], out[Value.LOG_RANGE, column + 1] = s1, s2
            out[Value.READINGS, column], out[Value.READINGS, column + 1] = o1, o2
    out[Value.CROSSTALK_1, 0], out[Value.CROSSTALK_2, 1] = 1.0, 1.0
    out[Value.READINGS, 0] += values[Value.CROSSTALK_1]
    out[Value.READINGS, 1] += values[Value.CROSSTALK_2]
    if background is not None:
        _add_background(out, r, values, factor, instrument)


@compiled
def _add_background(
    out: Array, r: float, values: Array, factor: float, instrument: Instrument
) -> None:
    """Add B S(r), S = (r^2 + c1' r) / Q' (docs/model.md, 3.30), and its derivatives."""
    r0, wave = instrument.r0, instrument.wave
    size, distance = values[Value.STRENGTH], values[Value.DISTANCE]
    c0, c1 = values[Value.SHADOW_C0], values[Value.SHADOW_C1]
    unit = (factor, distance, c0, c1)  # a strength of one
    b1, b2 = background_readings(r, r0, wave, unit)
    out[Value.STRENGTH, 0], out[Value.STRENGTH, 1] = b1, b2
    out[Value.READINGS, 0] += size * b1
    out[Value.READINGS, 1] += size * b2
    visible = 1.0
    if math.isfinite(r):
        visible = shadow(r, c0, c1)
        q = quadratic(r, c0, c1)
        bare1, bare2 = background_readings(math.inf, r0, wave, unit)
        along0, along1 = -size * r * (r + c1) / q / q, size * c0 * r / q / q
        out[Value.SHADOW_C0, 0], out[Value.SHADOW_C0, 1] = along0 * bare1, along0 * bare2
        out[Value.SHADOW_C1, 0], out[Value.SHADOW_C1, 1] = along1 * bare1, along1 * bare2
        a1, a2 = background_slopes(r, r0, wave, (size * factor, distance, c0, c1))
        out[Value.LOG_RANGE, 0] += a1
        out[Value.LOG_RANGE, 1] += a2
    slope1, slope2 = _distance_slopes(distance, r0, wave)
    out[Value.DISTANCE, 0] = size * factor * visible * slope1
    out[Value.DISTANCE, 1] = size * factor * visible * slope2


@compiled
def _distance_slopes(
    distance: float, r0: Reach, wave: tuple[float, float] | None
) -> tuple[float, float]:
    """Return how the readings of one unit of flux change with the distance that it comes from."""
    if wave is not None:
        phase = wave[0] * distance + wave[1]
        return -wave[0] * math.sin(phase), wave[0] * math.cos(phase)
    return late_rate(distance, r0), 0.0


@compiled
def _fill_all(
    out: Array,
    log_r: Array,
    values: Array,
    gains: Array,
    factors: Array,
    background: bool | None,
    instrument: Instrument,
) -> None:
    """Fill the slopes of all frames."""
    for j in range(log_r.size):
        fill_slopes(out[j], log_r[j], values, gains[j], factors[j], background, instrument)


@dataclasses.dataclass(frozen=True, eq=False)
class Sensitivity:
    """Mean readings of n frames and how they change.

    Attributes
    ----------
    mean : ndarray, shape (n, 2)
        Mean readings [reading units].
    signal : ndarray, shape (n, 2)
        The object's part of them; zero for a frame without object.
    by_term : ndarray, shape (n, 2, 9, 11 or 13)
        Derivatives along `inference.frame.coordinates.COORDINATES`, along the gain's log and the
        lag where something of the sensor is unknown, and along its temperature coefficients.
    by_range : ndarray, shape (n, 2)
        Derivative along log r; zero for a frame without object.
    """

    mean: Array
    signal: Array
    by_term: Array
    by_range: Array


def sensitivity(
    sensor: Sensor,
    terms: Terms,
    log_r: Array,
    gain: Array | None = None,
    flux_error: tuple[Array, Array] | None = None,
) -> Sensitivity:
    """Differentiate the mean readings.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    terms : Terms
        Physical values; the first parameter vector is used.
    log_r : ndarray, shape (n,)
        log r of every frame [log m]; nan for a frame without object.
    gain : ndarray, shape (n,) or (n, 2), optional
        Factor of each frame on the sensor's gain, and by how much warmer than its reference the
        sensor was [K]; left out: not at all.
    flux_error : (ndarray, ndarray), each of shape (n,), optional
        Logarithm of the factor by which the object's flux differs from the model's, and its slope
        along log r.

    Returns
    -------
    Sensitivity
        Not finite where a number overflows.
    """
    sensor = sensor_at(sensor, terms)
    of_sensor = any(each is not None for each in (terms.gain, terms.lag, terms.drift))
    n = log_r.size
    factors, warm = circuits(n, gain)
    if terms.drift is not None:
        factors = factors * (1.0 + terms.drift[0, 0] * warm)
    gains = np.full(n, sensor.known_gain)
    values, scales = np.zeros(Value.LOG_RANGE), np.ones(Value.LOG_RANGE)
    values[: Value.CROSSTALK_1] = terms.object[0]
    if terms.crosstalk is not None:
        values[Value.CROSSTALK_1 : Value.STRENGTH] = terms.crosstalk[0]
    if terms.background is not None:
        values[Value.STRENGTH :] = terms.background[0]
    scales[:] = values
    scales[Value.C1] = math.sqrt(values[Value.C0])
    scales[Value.SHADOW_C1] = math.sqrt(values[Value.SHADOW_C0])
    scales[Value.CROSSTALK_1 : Value.STRENGTH] = 0.0 if terms.crosstalk is None else 1.0
    slopes = np.empty((n, SLOPES, 4))
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        if flux_error is not None:
            gains *= np.exp(flux_error[0])
        background = None if terms.background is None else True
        ranges = np.ascontiguousarray(log_r)
        _fill_all(slopes, ranges, values, gains, factors, background, instrument_of(sensor))
        signal = slopes[:, Value.READINGS, 2:]
        by_range = slopes[:, Value.LOG_RANGE, :2]
        if flux_error is not None:
            by_range = by_range + flux_error[1][:, None] * signal
        by_term = slopes[:, : Value.LOG_RANGE, :2].transpose(0, 2, 1) * scales
        if of_sensor:
            light = slopes[:, Value.READINGS, :2] - values[Value.CROSSTALK_1 : Value.STRENGTH]
            lag = np.zeros_like(light)
            if terms.lag is not None:
                lag = by_lag(sensor, light, signal, np.exp(log_r), values[Value.DISTANCE])
            by_term = np.concatenate([by_term, np.stack([signal, lag], axis=2)], axis=2)
        mean = slopes[:, Value.READINGS, :2]
        if terms.drift is not None:
            # everything but crosstalk comes later by what the delay has drifted
            static, delay = slice(Value.CROSSTALK_1, Value.STRENGTH), terms.drift[0, 1] * warm
            mean = values[static] + delayed_light(sensor, mean - values[static], delay)
            turned = delayed_light(sensor, by_term, delay)
            turned[:, :, static] = by_term[:, :, static]
            by_drift = slopes_of_drift(sensor, terms.drift[0], warm, mean - values[static])
            by_term = np.concatenate([turned, by_drift], axis=2)
            signal = delayed_light(sensor, signal, delay)
            by_range = delayed_light(sensor, by_range, delay)
    return Sensitivity(mean, signal, by_term, by_range)


def whiteners(sensor: Sensor, of: Sensitivity) -> Array:
    """Return W with W^T W the inverse covariance of a frame's readings (`inference.frame.noise`).

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    of : Sensitivity
        Mean readings, on which shot and relative noise depend.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Lower triangular [1 / reading units].
    """
    return whiteners_at(instrument_of(sensor), of.mean, of.signal)
