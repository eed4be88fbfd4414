"""What frames without the object say against what a scene states in numbers."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.known import known_of
from inference.realtime.net import ABSENT, rule_out
from simulator.frames import Frames
from simulator.joint_scene import around, centre
from simulator.scene import Scene
from simulator.sensor import PulsedSensor, Sensor

__all__ = ["Contradiction", "contradiction", "covariance_of_empty"]

Array = NDArray[np.float64]

# standard errors of the mean of the empty frames: of two columns a false alarm of 1e-6
_BEYOND = 5.0


class Contradiction(NamedTuple):
    """How empty frames contradict what a scene states in numbers.

    Attributes
    ----------
    said : str
        For a person.
    light : (float, float)
        What they read on average beyond what the numbers make of them, in reading units.
    """

    said: str
    light: tuple[float, float]


class _Stated(NamedTuple):
    """What a scene's numbers make of empty frames."""

    crosstalk: Array  # (2,)
    wall: Array | None  # (2,): what a strength of 1 reads on average; None without a wall
    moved: Array | None  # (2,): its change with the distance [1/m]
    strength: float | None  # None where it is not known


def contradiction(
    scene: Scene, sensor: Sensor, frames: Frames, open_: tuple[float, float] | None = None
) -> Contradiction | None:
    """Return how empty frames contradict what the scene states in numbers.

    A joint law counts by its centre and its spread, a wall by the error of the effective distance
    that the scene grants; where the wall's strength is unknown, its direction counts alone.

    Parameters
    ----------
    scene, sensor, frames : Scene, Sensor, Frames
        The request.
    open_ : (float, float), optional
        Standard deviations of the crosstalk, where its numbers are medians of priors.

    Returns
    -------
    Contradiction or None
        None where they agree within 5 standard errors (false alarm 1e-6), where there are none,
        and where the scene leaves open what they should read.
    """
    if frames.object_present is None:
        return None
    empty = frames.select(np.flatnonzero(rule_out(sensor, frames) == ABSENT))
    n = len(empty.readings)
    stated = _stated(*centre(sensor, scene), empty) if n else None
    if stated is None:
        return None
    mean = empty.readings.mean(axis=0)
    strength = stated.strength
    beyond = mean - stated.crosstalk
    if stated.wall is not None and strength is None:
        strength = max(float(beyond @ stated.wall / (stated.wall @ stated.wall)), 0.0)
    of_wall = np.zeros(2) if stated.wall is None else (strength or 0.0) * stated.wall
    beyond = beyond - of_wall
    variance = covariance_of_empty(sensor, stated.crosstalk + of_wall) / n
    if open_ is not None:
        variance += np.diag(np.square(open_))
    for change in _shared(scene, sensor, empty, stated, strength):
        variance += np.outer(change, change)
    # readings are rounded, however little noise they have
    least = np.finfo(float).eps * np.abs(stated.crosstalk + of_wall)
    if stated.strength is None and strength:
        assert stated.wall is not None  # noqa: S101  # there is a strength
        across = np.array([-stated.wall[1], stated.wall[0]]) / np.linalg.norm(stated.wall)
        error = max(float(np.sqrt(across @ variance @ across)), float(least.max()))
        away = abs(float(across @ beyond)) / error
        said = [_read(sensor, mean, away)] if away > _BEYOND else []
    else:
        errors = np.maximum(np.sqrt(np.diag(variance)), least)
        said = [
            f"{column} {mean[k]:.4g} where {mean[k] - beyond[k]:.4g} is stated "
            f"({abs(beyond[k]) / errors[k]:.2g} off)"
            for k, column in enumerate(sensor.columns)
            if abs(beyond[k]) > _BEYOND * errors[k]
        ]
    if not said:
        return None
    remedy = "as numbers or as priors"
    if scene.background is None:
        remedy += ", or a `background` where a wall stands behind the object"
    else:
        remedy += ", or the `background` as it is, its distance_m as a prior where in doubt"
    return Contradiction(
        f"the {n} empty frames (object_present false) contradict the scene: on average they read "
        f"{' and '.join(said)}, in standard errors of that mean. Ranges take this light for the "
        "object's, and none is given that it moves by more than a standard deviation: state "
        f"`crosstalk` {remedy}",
        (float(beyond[0]), float(beyond[1])),
    )


def _read(sensor: Sensor, mean: Array, away: float) -> str:
    first, second = sensor.columns
    return (
        f"{first} {mean[0]:.4g} and {second} {mean[1]:.4g} where no strength of a wall at the "
        f"stated distance gives both ({away:.2g} off)"
    )


def covariance_of_empty(sensor: Sensor, light: Array) -> Array:
    """Return the covariance of one empty frame that reads some light, shape (2, 2)."""
    shot = sensor.noise.shot * np.abs(light)
    matrix = np.diag(np.square(sensor.noise.read) + shot)
    if isinstance(sensor, PulsedSensor):
        matrix[0, 1] = matrix[1, 0] = shot[0]
    if sensor.noise.flickers:
        matrix += np.outer(sensor.noise.relative * light, sensor.noise.relative * light)
    return matrix


def _shared(
    scene: Scene, sensor: Sensor, empty: Frames, stated: _Stated, strength: float | None
) -> list[Array]:
    """Return what moves all empty frames alike, each by a standard deviation, shape (2,)."""

    def light(of: Sensor, at: Scene) -> Array | None:
        numbers = _stated(of, at, empty)
        if numbers is None or numbers.wall is None:
            return None if numbers is None else numbers.crosstalk
        own = strength if numbers.strength is None else numbers.strength
        return numbers.crosstalk + (own or 0.0) * numbers.wall

    changes = []
    if stated.moved is not None and strength:
        changes.append(scene.model_error.range_m * strength * stated.moved)
    for plus, minus in around(sensor, scene) if scene.joint is not None else ():
        up, down = light(*plus), light(*minus)
        if up is not None and down is not None:
            changes.append(0.5 * (up - down))
    return changes


def _stated(sensor: Sensor, scene: Scene, empty: Frames) -> _Stated | None:
    """Return what empty frames read by the scene's numbers; None: not all that it takes known."""
    known = known_of(scene, sensor)
    if known.crosstalk is None:
        return None
    crosstalk = np.asarray(known.crosstalk)
    if scene.background is None:
        return _Stated(crosstalk, None, None, None)
    if not known.has("background.distance_m") or scene.background.optional:
        return None
    delay = sensor.timing_offset_s if isinstance(sensor, PulsedSensor) else sensor.phase_offset_rad
    if sensor.temperature is not None or not isinstance(delay, float | int | None):
        return None
    # only a scene with a wall asks for it
    from inference.fits.linear.light import carrier

    distance = known.get("background.distance_m")
    gain = float(empty.gains.mean())
    if isinstance(sensor, PulsedSensor):
        if delay is not None:
            distance += sensor.known_shift_m
        moved = np.array([float(distance < sensor.r0) / sensor.r0, 0.0])
    unit = carrier(sensor, np.array([distance]))[0]
    if not isinstance(sensor, PulsedSensor):
        moved = sensor.wave_number * np.array([-unit[1], unit[0]])
    strength = known.numbers.get("background.strength")
    return _Stated(crosstalk, gain * unit, gain * moved, strength)
