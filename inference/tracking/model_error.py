"""What smooth errors of the model, and of its table, do to what a tracker reads.

docs/model.md, model-error, has the model.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.frame.delayed import delayed
from inference.tracking.observed import Observed
from inference.tracking.tabulate import MEAN, OBJECT, OBJECT_SLOPE, SLOPE, Knots, means_over
from simulator.discrepancy import SLOPE_SD, discrepancy_basis
from simulator.model_error import ModelError
from simulator.object_arrays import shadows
from simulator.parameters import Terms
from simulator.sensor import PulsedSensor, Sensor, instrument
from simulator.shadow_error import shadow_errors

__all__ = ["model_changes", "sd_by_derivatives", "sd_by_table"]

Array = NDArray[np.float64]

_NEGLECTED = 1e-3  # of the variance: every function is another state of the filter
_WIDEST = 10.0  # of log r: nothing is known
# standard deviations at which the turn of a sine wave is squared, as in `second_order`
_TAKEN_AT = 2.0


def _shapes(positions: Array, sd: float) -> Array:
    """Return the functions of a smooth error along the range, shape (k, n), in ascending u."""
    low, high = np.exp(positions[[0, -1]]).tolist()
    return sd * discrepancy_basis(low, high, _NEGLECTED).values(positions).T


def model_changes(
    sensor: Sensor, error: ModelError, terms: Terms, knots: Knots, scale: Array
) -> list[Array]:
    """Return what every function of the model's errors does to the readings.

    Parameters
    ----------
    error : ModelError
        Sizes of the errors.
    terms : Terms
        The scene; of its background the first parameter vector is used.
    knots : Knots
        Where readings are tabulated.
    scale : ndarray, shape (2,)
        From readings to units of the noise.

    Returns
    -------
    list of ndarray, shape (n, 2)
        In units of the noise.
    """
    light, flux = knots.means[:, OBJECT], error.flux
    _, wave = instrument(sensor)
    if wave is not None:
        # light that is turned points less far to where it was: by half the square of the angle,
        # which is felt where neither noise nor an error of the flux is as large
        flux = math.hypot(flux, 0.5 * (_TAKEN_AT * wave[0] * error.range_m) ** 2)
    changes = []
    if flux > 0:
        changes += [light * s[:, None] for s in _shapes(knots.positions, flux)]
    if error.range_m > 0:
        late = _delayed(sensor, light, knots.positions, scale)
        changes += [late * s[:, None] for s in _shapes(knots.positions, error.range_m)]
    return changes + _shadow_changes(sensor, error, terms, knots, scale)


def _delayed(sensor: Sensor, light: Array, log_r: Array, scale: Array) -> Array:
    """Return the change of light with the distance that it seems to come, in units of the noise."""
    with np.errstate(divide="ignore", invalid="ignore"):
        raw = np.where(scale > 0, light / scale, 0.0)
    if isinstance(sensor, PulsedSensor) and not scale[1] > 0:
        raw[:, 1] = raw[:, 0] * sensor.r0 / (np.exp(log_r) + sensor.known_shift_m)
    return delayed(raw, log_r, *instrument(sensor)) * scale


def _shadow_changes(
    sensor: Sensor, error: ModelError, terms: Terms, knots: Knots, scale: Array
) -> list[Array]:
    """Return what every function of the shadow's errors does to the readings."""
    if terms.background is None or not error.shadow > 0:
        return []
    _, distance, c0, c1 = terms.background[0].tolist()
    r = np.exp(knots.positions)
    by_light, by_distance = shadow_errors(shadows(r, c0, c1))
    behind = knots.means[:, MEAN] - knots.means[:, OBJECT]
    farther = _delayed(sensor, behind, np.full(r.size, math.log(distance)), scale)
    shapes = _shapes(knots.positions, error.shadow)
    changes = (behind * by_light[:, None], farther * (distance * by_distance)[:, None])
    return [change * s[:, None] for change in changes for s in shapes]


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
    at = knots.positions, *instrument(sensor)
    parts = (
        (error.beside_numbers().flux, change),
        (error.flux * SLOPE_SD, light),
        (error.range_m, delayed(change, *at)),
        (error.range_m * SLOPE_SD, delayed(light, *at)),
    )
    with np.errstate(all="ignore"):
        turn = _cross(along, bend)
        square = sum((sd * _cross(along, part) / turn) ** 2 for sd, part in parts)
        sd = np.sqrt(square)
    return np.where(sd < _WIDEST, sd, _WIDEST)


def sd_by_table(knots: Knots, by_rate: bool) -> Array | None:
    """Return how far errors of the table move log r: as far in every frame at one range.

    Parameters
    ----------
    knots : Knots
        Where readings are tabulated.
    by_rate : bool
        Whether derivatives in time are read, of which the direction tells the range.

    Returns
    -------
    ndarray, shape (n,), or None
        At every knot; None where the noise hides them all.
    """
    if knots.error == 0.0:
        return None
    means, slopes = knots.means[:, MEAN], knots.means[:, SLOPE]
    with np.errstate(all="ignore"):
        if by_rate:
            sd = knots.error * np.sqrt(2.0) * means.prod(axis=1) / _cross(means, slopes)
        else:
            square = (slopes**2).sum(axis=1)
            sd = knots.error * np.sqrt(((slopes * means) ** 2).sum(axis=1)) / square
    # at a fold the second order tells the range
    return np.asarray(np.fmin(np.abs(sd), math.sqrt(knots.error)))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
