"""What smooth errors of the model do to what a tracker reads (docs/model.md, model-error)."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.tracking.observed import Observed
from inference.tracking.tabulate import MEAN, OBJECT, OBJECT_SLOPE, SLOPE, Knots, means_over
from simulator.discrepancy import DISCREPANCY_LENGTH, matern
from simulator.model_error import ModelError
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["model_changes", "principal_shapes", "sd_by_derivatives"]

Array = NDArray[np.float64]

_SLOPE = math.sqrt(5.0 / 3.0) / DISCREPANCY_LENGTH  # sd of a Matern 5/2 process' slope over its own
_WIDEST = 10.0  # of log r: nothing is known


def principal_shapes(positions: Array, sd: float) -> Array:
    """Return the principal shapes of a smooth error along the range.

    Its covariance is `simulator.discrepancy.matern`. The shapes hold all but a thousandth of its
    variance.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        u = log r.
    sd : float
        Standard deviation of the error.

    Returns
    -------
    ndarray, shape (k, n)
    """
    nodes = np.linspace(positions[0], positions[-1], 200)
    values, vectors = np.linalg.eigh(matern(nodes[:, None] - nodes))
    values, vectors = values[::-1], vectors[:, ::-1]
    kept = int(np.searchsorted(np.cumsum(values), 0.999 * values.sum())) + 1
    shapes = sd * np.sqrt(values[:kept]) * vectors[:, :kept]
    return np.array([np.interp(positions, nodes, shape) for shape in shapes.T])


def _by_delay(sensor: Sensor, light: Array, positions: Array) -> Array:
    """Return the change of an object's readings with its effective distance, shape (n, 2) [1/m].

    Linear in the readings of a wave and in the light of a pulse, so that slopes go in as well.
    """
    if isinstance(sensor, PulsedSensor):
        return np.column_stack([light[:, 1] / sensor.r0, np.zeros(positions.size)])
    return sensor.wave_number * np.column_stack([-light[:, 1], light[:, 0]])


def model_changes(sensor: Sensor, error: ModelError, knots: Knots, scale: Array) -> list[Array]:
    """Return what every principal shape of the model's errors does to the readings.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    error : ModelError
        Sizes of the errors.
    knots : Knots
        Where readings are tabulated.
    scale : ndarray, shape (2,)
        From readings to units of the noise.

    Returns
    -------
    list of ndarray, shape (n, 2)
        In units of the noise.
    """
    light = knots.means[:, OBJECT]
    changes = []
    if error.flux > 0:
        changes += [light * s[:, None] for s in principal_shapes(knots.positions, error.flux)]
    if error.range_m > 0:
        with np.errstate(divide="ignore", invalid="ignore"):
            raw = np.where(scale > 0, light / scale, 0.0)
        if isinstance(sensor, PulsedSensor) and not scale[1] > 0:
            raw[:, 1] = raw[:, 0] * sensor.r0 / np.exp(knots.positions)
        delayed = _by_delay(sensor, raw, knots.positions) * scale
        changes += [delayed * s[:, None] for s in principal_shapes(knots.positions, error.range_m)]
    return changes


def sd_by_derivatives(
    sensor: Sensor, error: ModelError, terms: Terms, knots: Knots, observed: Observed
) -> Array | None:
    """Return how far errors of the model move log r as derivatives in time tell it.

    Their direction tells the range, and the rate is free, so the errors' slopes count. The filter
    does not carry them along: they are added to what it says.

    Parameters
    ----------
    sensor, error, knots
        As for `model_changes`.
    terms : Terms
        The scene.
    observed : Observed
        What is read.

    Returns
    -------
    ndarray, shape (n,), or None
        Standard deviation of log r at every knot; None where the filter carries the errors, or
        there are none.
    """
    if not observed.by_rate or not (error.flux > 0 or error.range_m > 0):
        return None
    plain = means_over(knots.positions, sensor, terms, False)
    rates = means_over(knots.positions, sensor, terms, True)
    along, bend = rates[:, MEAN], rates[:, SLOPE]
    light, change = plain[:, OBJECT], plain[:, OBJECT_SLOPE]
    delayed = _by_delay(sensor, light, knots.positions)
    parts = (
        (error.beside_numbers().flux, change),
        (error.flux * _SLOPE, light),
        (error.range_m, _by_delay(sensor, change, knots.positions)),
        (error.range_m * _SLOPE, delayed),
    )
    with np.errstate(all="ignore"):
        turn = _cross(along, bend)
        square = sum((sd * _cross(along, part) / turn) ** 2 for sd, part in parts)
        sd = np.sqrt(square)
    return np.where(sd < _WIDEST, sd, _WIDEST)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
