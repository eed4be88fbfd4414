"""Seeded simulation of frames from a scene, a sensor and a trajectory."""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.discrepancy import matern
from simulator.errors import InvalidInputError
from simulator.frames import Frames
from simulator.model_error import ModelError
from simulator.overflow import check_drawn, check_readings
from simulator.parameters import Terms, parameters_of
from simulator.readings import (
    background_readings,
    late_share,
    light_that_errs,
    noise_parts,
    object_readings,
)
from simulator.scene import Scene
from simulator.sensor import Reach, Sensor, instrument
from simulator.sensor_unknowns import sensor_at
from simulator.trajectories import RadialTrajectory, SampledTrajectory
from simulator.warmed import temperatures, warmed

__all__ = ["Simulation", "erring_readings", "mean_readings", "simulate"]

Array = NDArray[np.float64]
Pair = tuple[float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Simulation:
    """Frames with the truth behind them.

    Attributes
    ----------
    frames : Frames
        What the sensor delivers.
    range_m : ndarray, shape (n,)
        True ranges [m]; nan where the scene is empty.
    parameters : dict of str to float
        Values of the scene's unknowns, by scene path, that were drawn from their priors.
    """

    frames: Frames
    range_m: Array
    parameters: dict[str, float]


# arguments of their own, no tuple of them: only so a term that is None costs no branch
@compiled
def _frame_moments(
    ranges: Array,
    factor: Array,
    late: Array | None,
    gain: float,
    r0: Reach,
    wave: Pair | None,
    shape: tuple[float, float, float],
    crosstalk: Pair | None,
    background: tuple[float, float, float, float] | None,
    read: Pair,
    shot: float | None,
    relative: float | None,
    of_source: bool,
) -> Array:
    """Return means and noise parts of every frame, shape (n, 7).

    ``late`` is what the time of flight tells too much [m]; None for an exact one.
    """
    out = np.empty((ranges.size, 7))
    for i in range(ranges.size):
        o1, o2 = 0.0, 0.0
        if np.isfinite(ranges[i]):
            strength = gain * shape[0] * shape[2] * factor[i]
            o1, o2 = object_readings(ranges[i], r0, wave, strength, shape[0], shape[1])
            if late is not None:
                if wave is not None:
                    cosine, sine = math.cos(wave[0] * late[i]), math.sin(wave[0] * late[i])
                    o1, o2 = o1 * cosine - o2 * sine, o1 * sine + o2 * cosine
                else:
                    o1 = o2 * max(late_share(ranges[i] + late[i], r0), 0.0)
        m1, m2 = o1, o2
        if background is not None:
            b1, b2 = background_readings(ranges[i], r0, wave, background)
            m1, m2 = m1 + b1, m2 + b2
        if crosstalk is not None:
            m1, m2 = m1 + crosstalk[0], m2 + crosstalk[1]
        errs = light_that_errs((m1, m2), (o1, o2), of_source)
        parts = noise_parts(read, shot, relative, wave is None, (m1, m2), errs)
        out[i, 0], out[i, 1] = m1, m2
        for j in range(5):
            out[i, 2 + j] = parts[j]
    return out


def _moments(
    sensor: Sensor, terms: Terms, ranges: Array, factor: Array, late: Array | None = None
) -> Array:
    c0, c1, c2 = terms.object[0].tolist()
    noise, sensor = sensor.noise, sensor_at(sensor, terms)
    r0, wave = instrument(sensor)
    return _frame_moments(
        ranges,
        factor,
        late,
        sensor.known_gain,
        r0,
        wave,
        (c0, c1, c2),
        None if terms.crosstalk is None else tuple(terms.crosstalk[0].tolist()),
        None if terms.background is None else tuple(terms.background[0].tolist()),
        noise.read,
        noise.shot or None,
        noise.relative or None,
        noise.flickers,
    )


def mean_readings(sensor: Sensor, terms: Terms, ranges: Array) -> Array:
    """Return noise-free readings of an object at given ranges.

    Parameters
    ----------
    sensor : Sensor
        The sensor.
    terms : Terms
        Physical values; the first parameter vector is used.
    ranges : ndarray, shape (n,)
        Ranges [m]; inf or nan where there is no object.

    Returns
    -------
    ndarray, shape (n, 2)
        w1, w2 or i, q [reading units].
    """
    ranges = np.where(np.isfinite(ranges), ranges, np.inf)
    return _moments(sensor, terms, ranges, np.ones(ranges.size))[:, :2]


def erring_readings(
    sensor: Sensor, terms: Terms, ranges: Array, wrong: ModelError, rng: np.random.Generator
) -> Array:
    """Return noise-free readings of an object that errs from its model.

    Parameters
    ----------
    sensor, terms, ranges
        As for `mean_readings`.
    wrong : ModelError
        Sizes of the errors, which are drawn.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    ndarray, shape (n, 2)
        w1, w2 or i, q [reading units].
    """
    ranges = np.where(np.isfinite(ranges), ranges, np.inf)
    factor, late = _errors(rng, ranges, wrong)
    return _moments(sensor, terms, ranges, factor, late)[:, :2]


def _errors(
    rng: np.random.Generator, ranges: Array, wrong: ModelError
) -> tuple[Array, Array | None]:
    """Draw by what factor the flux errs, and by how much the effective distance [m]."""
    factor, late = np.ones(ranges.size), None
    if wrong.flux > 0:
        factor = np.exp(_smooth_error(rng, ranges, wrong.flux))
    if wrong.range_m > 0:
        late = _smooth_error(rng, ranges, wrong.range_m)
    return factor, late


def _smooth_error(rng: np.random.Generator, ranges: Array, sd: float) -> Array:
    """Draw a Gaussian process along log r with Matern 5/2 covariance at given ranges."""
    logs = np.log(ranges[np.isfinite(ranges)])
    if logs.size == 0:
        return np.zeros(ranges.size)
    knots = np.linspace(logs.min() - 1e-9, logs.max() + 1e-9, 200)
    # a smooth kernel is singular to rounding: the square root is taken from its eigenvalues; the
    # symmetric one, as eigenvectors have another sign on another processor
    values, vectors = scipy.linalg.eigh(matern(knots[:, None] - knots[None, :]))
    along = vectors.T @ rng.standard_normal(knots.size)
    path = sd * vectors @ (np.sqrt(np.maximum(values, 0.0)) * along)
    finite = np.where(np.isfinite(ranges), ranges, np.exp(knots[0]))
    return np.asarray(np.interp(np.log(finite), knots, path))


def simulate(
    sensor: Sensor,
    scene: Scene,
    trajectory: RadialTrajectory | SampledTrajectory,
    seed: int | np.random.Generator,
) -> Simulation:
    """Simulate frames.

    Parameters
    ----------
    sensor : Sensor
        Its noise is added; readings are cut at its full scale. Unknowns are drawn once from their
        priors.
    scene : Scene
        Unknowns are drawn once from their priors, and so are model errors that it states in
        numbers; its default of them adds nothing.
    trajectory : RadialTrajectory or SampledTrajectory
        True ranges, used as they are; a scene's ``range_m`` plays no part.
    seed : int or numpy.random.Generator
        Source of randomness; the same seed gives the same frames.

    Returns
    -------
    Simulation
        Frames and truth.

    Raises
    ------
    InvalidInputError
        Where `check_scene` refuses the scene, and where a reading is beyond what a number can
        hold. Pointers are those of a request: below "/sensor", "/scene", "/trajectory".
    RefusedError
        Where the priors of the scene all but exclude one another.
    """
    rng = np.random.default_rng(seed)
    try:
        parameters = parameters_of(sensor, scene)
    except InvalidInputError as error:
        raise error.below("/scene") from None
    z = parameters.sample(rng, 1)
    drawn = dict(zip(parameters.names, parameters.natural(z)[0].tolist(), strict=True))
    check_drawn(scene, drawn)
    ranges = trajectory.ranges()
    factor = np.ones(ranges.size)
    present = None
    if isinstance(trajectory, SampledTrajectory):
        if trajectory.amplitude is not None:
            factor = np.asarray(trajectory.amplitude)
        if trajectory.object_present is not None:
            present = np.asarray(trajectory.object_present)
            ranges = np.where(present, ranges, np.inf)
    # overflow shows in the result, which is checked
    with np.errstate(over="ignore", invalid="ignore"):
        late = None
        wrong = scene.model_error
        if wrong.integrated:
            by, late = _errors(rng, ranges, wrong)
            factor = factor * by
        terms = parameters.terms(z)
        moments = _moments(sensor, terms, ranges, factor, late)
        temperature = temperatures(sensor, trajectory)
        if temperature is not None:
            bare = dataclasses.replace(terms, crosstalk=None, background=None)
            light = _moments(sensor, bare, ranges, factor, late)[:, :2]
            moments = warmed(sensor_at(sensor, terms), terms, moments, light, temperature)
        readings = moments[:, :2] + _noise(rng, *moments[:, 2:].T)
    check_readings(sensor_at(sensor, terms), trajectory, factor, moments, readings)
    if sensor.full_scale is not None:
        limit = np.asarray(sensor.full_scale)
        readings = np.clip(readings, -limit, limit)
    known, sds = _known_ranges(rng, trajectory, ranges, sensor.max_range_m)
    frames = Frames(
        readings,
        time_s=trajectory.times(),
        object_present=present,
        known_range_m=known,
        known_range_sd_m=sds,
        temperature_k=temperature,
    )
    truth = np.where(np.isfinite(ranges), ranges, np.nan)
    return Simulation(frames, truth, drawn)


def _known_ranges(
    rng: np.random.Generator,
    trajectory: RadialTrajectory | SampledTrajectory,
    ranges: Array,
    farthest: float,
) -> tuple[Array | None, Array | None]:
    """Draw what is known of ranges, last of all; nan where that is nothing or cannot be."""
    sds = trajectory.known_range_sds()
    if sds is None:
        return None, None
    known = ranges + sds * rng.standard_normal(ranges.size)
    told = np.isfinite(known) & (known > 0) & (known <= farthest)
    if not told.any():
        return None, None
    return np.where(told, known, np.nan), np.where(told, sds, np.nan)


def _noise(
    rng: np.random.Generator, own1: Array, own2: Array, shared: Array, s1: Array, s2: Array
) -> Array:
    """Draw noise from its independent parts, shape (n, 2)."""
    normal = rng.standard_normal((4, own1.size))
    common = np.sqrt(shared) * normal[2]
    return np.column_stack(
        [
            np.sqrt(own1) * normal[0] + common + s1 * normal[3],
            np.sqrt(own2) * normal[1] + common + s2 * normal[3],
        ]
    )
