"""How wide intervals must be where errors of the model are shared by all frames, to first order.

At the truth the readings are linear in object, crosstalk, offset of displacements, ranges and the
coefficients of the errors of flux and effective distance (docs/model.md, discrepancy-law). Each
has its prior: the bound is the covariance of that. Whose ranges are all known also says how large
these errors were.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.identifiability.before_data import Foresight, identifiability
from inference.identifiability.experiment import Experiment
from inference.identifiability.range_response import range_response
from inference.identifiability.response_rows import ResponseRows
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.scene import parse_scene
from simulator.sensor import Sensor

__all__ = ["Truth", "beyond", "demanded", "fitted_object", "widths"]

Array = NDArray[np.float64]

_Z = 1.6448536269514722  # of a 90 % interval
_NEAR_ZERO = 1e-9  # where a prior has no less than zero
_KNOWN_M = 3e-4  # to which the robot's ranges are taken to be known


class Truth(NamedTuple):
    """A measurement, and the truth behind it.

    Attributes
    ----------
    sensor : Sensor
        The sensor.
    scene : dict
        As stated, without a discrepancy.
    range_m : ndarray, shape (n,)
        True ranges [m]; nan without an object.
    at : mapping of str to float
        The scene's unknowns.
    """

    sensor: Sensor
    scene: dict[str, Any]
    range_m: Array
    at: Mapping[str, float]


def fitted_object(light: Array, range_m: Array) -> dict[str, float]:
    """Return c0, c1 and c2 that explain light best, in relative terms.

    Parameters
    ----------
    light : ndarray, shape (n,)
        The object's, over the sensor's gain [1/m^2].
    range_m : ndarray, shape (n,)
        True ranges [m].
    """

    def of(x: Array) -> tuple[float, float, float]:
        c0 = math.exp(x[0])
        return c0, 2.0 * math.sqrt(c0) * math.expm1(x[1]), math.exp(x[2])

    def off(x: Array) -> Array:
        c0, c1, c2 = of(x)
        model = c0 * c2 / (range_m**2 * (range_m**2 + c1 * range_m + c0))
        return np.asarray(np.log(light / model))

    starts = [(a, b, -2.0) for a in (-4.0, -2.0, 0.0) for b in (-0.7, 0.0, 0.5)]
    found = min((scipy.optimize.least_squares(off, s) for s in starts), key=lambda fit: fit.cost)
    return dict(zip(("object.c0", "object.c1", "object.c2"), of(found.x), strict=True))


def _foresight(truth: Truth, times: float, known: Any, displacement: Any) -> Foresight:
    """Return what is foreseen at the truth, the flux's error being ``times`` the default's.

    That of the effective distance is added by who asks, known ranges being exactly as told.
    """
    sizes = {"flux": times * DISCREPANCY_SD}
    scene = parse_scene(truth.scene | {"discrepancy": sizes})
    there = np.isfinite(truth.range_m)
    at = {name: value or _NEAR_ZERO for name, value in truth.at.items()}
    ranges = np.where(there, truth.range_m, 1.0).tolist()
    return identifiability(
        truth.sensor,
        scene,
        ranges,
        there.tolist(),
        at,
        known_range_sd_m=known,
        displacement_sd_m=displacement,
    )


def _where(told: Array | None, sd: Array | None) -> list[float | None] | None:
    if told is None or sd is None:
        return None
    pairs = zip(np.isfinite(told).tolist(), sd.tolist(), strict=True)
    return [size if there else None for there, size in pairs]


def widths(truth: Truth, frames: Frames, times: float = 1.0) -> Array:
    """Return bounds on the widths of 90 % intervals of the ranges, over the ranges, shape (n,).

    Parameters
    ----------
    truth : Truth
        The measurement.
    frames : Frames
        What is known of ranges beside the readings.
    times : float
        Errors of the model over those that stand by default.
    """
    known = _where(frames.known_range_m, frames.known_range_sd_m)
    moved = _where(frames.displacement_m, frames.displacement_sd_m)
    found = _foresight(truth, times, known, moved)
    experiment, size = found.experiment, times * RANGE_ERROR_SD
    variance = np.square(found.posterior.range_sd)
    if experiment.rates is None:
        # each range follows an error of the distance by itself
        variance = variance + np.square(size / truth.range_m)
    else:
        seen = np.column_stack([experiment.readings.mean, experiment.told])
        response = range_response(experiment, seen, size)[1]
        variance = variance + np.square(response[:, 1:]).sum(axis=1)
    return np.asarray(2.0 * _Z * np.sqrt(variance))


def demanded(truth: Truth, frames: Frames) -> float:
    """Return how large errors of the model were, over those that stand by default.

    That is the root of the mean square of the coefficients that the readings tell where all ranges
    are known (Birge's ratio).
    """
    here = np.isfinite(truth.range_m)
    known = [_KNOWN_M if there else None for there in here.tolist()]
    experiment = _foresight(truth, 1.0, known, None).experiment
    best, spread, own, count = _solved(experiment, frames, here)
    errors = slice(own, count)
    told = count - own - np.square(spread[errors]).sum()
    return float(math.sqrt(np.square(best[errors]).sum() / told))


def beyond(truth: Truth, frames: Frames) -> Array:
    """Return by how many standard deviations ranges are missed, to first order, shape (n,).

    Parameters
    ----------
    truth : Truth
        The measurement.
    frames : Frames
        Its readings, and what is known of ranges beside them.

    Returns
    -------
    ndarray
        What the readings and the priors move each range by from the truth, over what they leave
        open of it; nan without an object.
    """
    here = np.isfinite(truth.range_m)
    known = _where(frames.known_range_m, frames.known_range_sd_m)
    moved = _where(frames.displacement_m, frames.displacement_sd_m)
    experiment = _foresight(truth, 1.0, known, moved).experiment
    best, spread, _, count = _solved(experiment, frames, here)
    off = np.full(here.size, np.nan)
    off[here] = best[count:] / np.sqrt(np.square(spread[count:]).sum(axis=1))
    return off


def _solved(experiment: Experiment, frames: Frames, here: Any) -> tuple[Array, Array, int, int]:
    """Return how far unknowns, errors of the model and log ranges are from the truth.

    And a root of their covariance, the number of the unknowns, and that of unknowns and errors.
    """
    rows = ResponseRows(experiment, RANGE_ERROR_SD)
    (n, m, d), k = rows.jacobian.shape, rows.by_error.shape[2]
    system = np.zeros((n * m + d + k, d + k + n))
    system[: n * m, :d] = rows.jacobian.reshape(-1, d)
    system[: n * m, d : d + k] = rows.by_error.reshape(-1, k)
    for frame in np.flatnonzero(here):
        system[frame * m : (frame + 1) * m, d + k + frame] = rows.along[frame]
    system[n * m :, : d + k] = np.eye(d + k)
    empty = np.flatnonzero(~here) + d + k
    system = np.delete(system, empty, axis=1)
    seen = frames.readings
    if experiment.told is not None:
        seen = np.column_stack([seen, experiment.told])
    own = experiment.z.size
    off = np.concatenate([rows.residual(seen).ravel(), -experiment.z, np.zeros(d - own + k)])
    factor, triangle = scipy.linalg.qr(system, mode="economic")
    best = scipy.linalg.solve_triangular(triangle, factor.T @ off)
    spread = scipy.linalg.solve_triangular(triangle, np.eye(len(triangle)))
    return best, spread, own, d + k
