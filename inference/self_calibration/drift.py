"""Crosstalk drifts: what was said of it grows old, and frames without the object renew it.

Between calibrations the crosstalk walks at random. The tracker does not learn the walk from frames
with the object: beside an object whose shape is open it would be sure and wrong (docs/limits.md).
The walk widens the law of the scene instead, in steps of its age, and is in every answer as an
error that its frames share. Frames without the object read the crosstalk itself, and condition the
law at once. How fast it walks is learnt from what calibrations and such frames found.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.self_calibration.mixing import with_modes
from inference.self_calibration.scenes import prior_scene
from inference.tracking.tabulate import empty_readings
from simulator.errors import InvalidInputError
from simulator.parameters import Parameters, parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor

__all__ = ["Drift", "EmptyMeans", "aged", "conditioned", "crosstalk_of", "drift_sd", "walked"]

Array = NDArray[np.float64]

_RATE = 0.01  # of the crosstalk, in the root of a second: a tenth of it in 100 s
_COUNTS = 4.0  # observations that this default counts for
_MOST = 4.0  # times the variance that was expected, of one observation: jumps are no walk
_SOONEST_S = 5.0  # between two observations that tell a walk
_DRAWS = 1000
_FARTHEST = 9.0  # standard deviations of a prior
_RIDGE = 1e-9  # of a variance: what keeps a law of two unknowns that are one a law


class Drift(NamedTuple):
    """How old the law of the scene in force is.

    Attributes
    ----------
    law : Scene
        What is known of the scene as it was.
    at_s : float
        When that was [s].
    until_s : float
        Up to which time the scene in force is wide enough for the walk [s].
    counted, square : float
        Number of observations of the walk, and the sum of the squares of its rates [1/s].
    jump : float
        Standard deviation of what frames that contradict the law demand beside the walk, of the
        crosstalk.
    """

    law: Scene
    at_s: float
    until_s: float
    counted: float = _COUNTS
    square: float = _COUNTS * _RATE**2
    jump: float = 0.0

    @property
    def rate(self) -> float:
        """Standard deviation by which the crosstalk walks in the root of a second, of itself."""
        return math.sqrt(self.square / self.counted)


class EmptyMeans(NamedTuple):
    """Readings of the empty scene.

    Attributes
    ----------
    values, sd : ndarray, shape (2,)
        Their mean, and its standard deviation [reading units].
    gain : float
        Factor on the sensor's gain.
    time_s : float
        When [s].
    """

    values: Array
    sd: Array
    gain: float
    time_s: float


@functools.lru_cache(maxsize=64)  # a look asks several times for the same law
def crosstalk_of(sensor: Sensor, scene: Scene) -> tuple[Array, Array] | None:
    """Return mean and standard deviation of unknown crosstalk.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene.

    Returns
    -------
    (ndarray, ndarray), each of shape (2,), or None
        In reading units; the deviation of a number that is known is 0. None where both are known,
        or there is none.
    """
    values = scene.crosstalk_values
    if values is None or all(isinstance(value, float | int) for value in values):
        return None
    parameters = parameters_of(sensor, scene)
    draws = parameters.terms(parameters.sample(np.random.default_rng(0), _DRAWS)).crosstalk
    if draws is None:
        return None
    return draws.mean(axis=0), draws.std(axis=0)


def drift_sd(
    sensor: Sensor, drift: Drift, seconds: float, stated: tuple[float, float] | None
) -> Array | None:
    """Return how far the crosstalk may have walked, and jumped.

    Parameters
    ----------
    sensor, drift : Sensor, Drift
        The law, and the rate that was learnt.
    seconds : float
        Since then [s].
    stated : (float, float), optional
        Walk in the root of a second [reading units]; left out, the rate that was learnt.

    Returns
    -------
    ndarray, shape (2,), or None
        In reading units; 0 of a number that is known. None where no crosstalk is unknown.
    """
    known = crosstalk_of(sensor, drift.law)
    if known is None:
        return None
    mean, sd = known
    size = np.abs(mean) + sd
    a_root_second = drift.rate * size if stated is None else np.array(stated)
    walk = a_root_second * math.sqrt(max(seconds, 0.0))
    return np.where(sd > 0.0, np.hypot(walk, drift.jump * size), 0.0)


def walked(drift: Drift, known: tuple[Array, Array], found: tuple[Array, Array], s: float) -> Drift:
    """Learn the rate from crosstalk that was found again.

    Parameters
    ----------
    drift : Drift
        What is known of the rate.
    known, found : (ndarray, ndarray)
        Mean and standard deviation of the crosstalk before and after [reading units].
    s : float
        Time between them [s].

    Returns
    -------
    Drift
    """
    if not s >= _SOONEST_S:
        return drift
    size = np.abs(known[0]) + known[1]
    used = (size > 0.0) & (known[1] > 0.0) & (found[1] > 0.0)
    if not used.any():
        return drift
    size = size[used]
    change = (found[0] - known[0])[used] / size
    noise = np.square(known[1][used] / size) + np.square(found[1][used] / size)
    rates = np.maximum(np.square(change) - noise, 0.0) / s
    # an observation that noise drowns tells little of the walk
    expected = drift.rate**2
    weight = np.square(expected * s / (expected * s + noise))
    rates = np.minimum(rates, _MOST * expected)
    return drift._replace(
        counted=drift.counted + float(weight.sum()),
        square=drift.square + float(weight @ rates),
    )


def aged(scene: Scene, names: tuple[str, ...], sd: Array) -> Scene:
    """Return a scene whose crosstalk may have walked.

    Parameters
    ----------
    scene : Scene
        With a joint law.
    names : tuple of str
        Names of the two crosstalk readings.
    sd : ndarray, shape (2,)
        How far [reading units].
    """
    joint, values = scene.joint, scene.crosstalk_values
    if joint is None or values is None or not (sd > 0.0).any():
        return scene
    modes = []
    for mode in joint.modes:
        matrix = np.array(mode.covariance)
        for name, value, size in zip(names, values, sd.tolist(), strict=True):
            if name not in joint.unknowns or isinstance(value, float | int) or not size > 0.0:
                continue
            j = joint.unknowns.index(name)
            law = value.distribution()
            z = float(np.clip(mode.mean[j], -_FARTHEST, _FARTHEST))
            x = law.from_normal(z)
            with np.errstate(all="ignore"):
                ends = np.array([law.to_normal(x + size) - z, z - law.to_normal(x - size)])
            sides = ends[np.isfinite(ends)]
            step = float(sides.mean()) if sides.size else _FARTHEST
            matrix[j, j] += min(step, _FARTHEST) ** 2
        modes.append({"weight": mode.weight, "mean": list(mode.mean), "covariance": matrix})
    return with_modes(scene, modes)


def conditioned(sensor: Sensor, scene: Scene, means: EmptyMeans) -> tuple[Scene, float]:
    """Return a scene that has learnt from readings without the object.

    Parameters
    ----------
    sensor, scene : Sensor, Scene
        The scene, with a joint law of all that is unknown.
    means : EmptyMeans
        The readings; those with an infinite standard deviation tell nothing.

    Returns
    -------
    (Scene, float)
        Its law conditioned, linear in a standard deviation of each unknown; and how much the
        readings surprise the mode that foresaw them best, a chi-square. Infinite, and the scene as
        it was, where the readings are farther from what was stated than any law may lie.
    """
    joint = scene.joint
    if joint is None:
        return scene, 0.0
    parameters = parameters_of(sensor, prior_scene(scene))
    where = [parameters.names.index(name) for name in joint.unknowns]
    modes, log_weights, surprises = [], [], []
    for mode in joint.modes:
        root = _root(np.array(mode.covariance))
        steps = np.sqrt(np.diagonal(np.array(mode.covariance)))
        mean = np.array(mode.mean)
        points = np.concatenate([mean[None], mean + np.diag(steps), mean - np.diag(steps)])
        z = np.zeros((len(points), len(parameters)))
        z[:, where] = points
        # in units of the noise, in which all of it is plain
        expected = _without_object(sensor, parameters, z, means.gain) / means.sd
        d = mean.size
        slope = (0.5 * (expected[1 : d + 1] - expected[d + 1 :]) / steps[:, None]).T
        off = means.values / means.sd - expected[0]
        whole = np.block([[np.eye(2), slope @ root], [np.zeros((d, 2)), root]])
        lower = np.asarray(np.linalg.qr(whole.T, mode="r")).T
        pull = np.linalg.solve(lower[:2, :2], off)
        after = lower[2:, 2:]
        covariance = after @ after.T
        covariance += np.diag(_RIDGE * np.maximum(np.diagonal(covariance), _RIDGE))
        surprises.append(float(pull @ pull))
        log_weights.append(
            math.log(mode.weight)
            - 0.5 * surprises[-1]
            - float(np.log(np.abs(np.diagonal(lower[:2, :2]))).sum())
        )
        modes.append({"mean": (mean + lower[2:, :2] @ pull).tolist(), "covariance": covariance})
    weights = np.exp(np.array(log_weights) - max(log_weights))
    weights /= weights.sum()
    kept = [
        mode | {"weight": float(weight)}
        for mode, weight in zip(modes, weights, strict=True)
        if weight > _RIDGE
    ]
    try:
        return with_modes(scene, kept), min(surprises)
    except InvalidInputError:  # farther from its priors than a scene may state
        return scene, math.inf


def _without_object(sensor: Sensor, parameters: Parameters, z: Array, gain: float) -> Array:
    """Return readings of the empty scene, shape (n, 2)."""
    rows = []
    for row in z:
        terms = parameters.terms(row[None])
        reading = gain * empty_readings(sensor, terms, False)
        rows.append(reading if terms.crosstalk is None else reading + terms.crosstalk[0])
    return np.array(rows)


def _root(covariance: Array) -> Array:
    scale = np.sqrt(np.diagonal(covariance))
    return np.asarray(scale[:, None] * np.linalg.cholesky(covariance / scale[:, None] / scale))
