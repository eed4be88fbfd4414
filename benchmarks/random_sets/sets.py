"""Random sets: a sensor, an object on its way, light that is not known, and what is told of it."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.classes import CLASSES, KINDS, SHADOW, at, surface
from benchmarks.coverage.paths import LIGHT, PATHS
from simulator.catalogue import PlateScene
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.electronics import Electronics
from simulator.optics.motion import series
from simulator.optics.parametrisation import fit_object
from simulator.optics.surfaces import Shell
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["RandomSet", "fitted_object", "random_set"]

Array = NDArray[np.float64]

_OPTICS = 1 / 3  # share of sets whose light is that of exact optics
_KNOWN = 0.5  # share in which the object is known
_SNR = (10.0, 1e5)
_FRAMES = (8, 40)
_EMPTY = (0, 0, 3, 6)
_TOLD = (1.0, 3.0, 10.0)  # standard deviation of the crosstalk that is told, over the true one
_WIDEST = 1.0  # of that in the signal in the middle of the stroke
_CALIBRATED_M = (0.1, 2.4)
_SILENT = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1.0, 1.0]}})


@dataclasses.dataclass(frozen=True, eq=False)
class RandomSet:
    """Readings with the truth.

    Attributes
    ----------
    name : str
        What it is.
    sensor : Sensor
        The sensor.
    frames : Frames
        Its readings; those without an object come first and are told so.
    scene : dict
        What inference is told.
    range_m : ndarray, shape (n,)
        True ranges [m]; nan where there is no object.
    parameters : dict of str to float
        True values of unknowns, by scene path; those of an object only where it is the model's.
    """

    name: str
    sensor: Sensor
    frames: Frames
    scene: dict[str, Any]
    range_m: Array
    parameters: dict[str, float]


@dataclasses.dataclass(frozen=True)
class _Light:
    """Light besides the object's: what it is, and what is told of it."""

    crosstalk: list[float] | None
    background: dict[str, Any] | None
    told: dict[str, Any]


def random_set(seed: int, number: int) -> RandomSet:
    """Draw a set.

    A path of `benchmarks.coverage.paths` over a stroke that starts at 0.1 to 0.4 m and ends 2 to 6
    times as far, 8 to 40 frames, none or three or six empty ones before them, a signal-to-noise
    ratio of 10 to 1e5 in the stroke's middle. Time passes so that the root mean square of d log r /
    dt is 1 / s, what a tracker supposes by default. A third of the sets are surfaces seen through
    exact optics, the others are of the object model with a smooth error as large as stands by
    default. Half of the objects are known, from a fit of their own light. Crosstalk is normal with
    a hundredth to a whole of the signal in the middle; what is told of it is as wide, three or ten
    times as wide, or, of known objects, every other time its numbers.

    Parameters
    ----------
    seed, number : int
        Of the study, a fresh one every time, and of the set in it.

    Returns
    -------
    RandomSet
    """
    rng = np.random.default_rng([seed, number])
    path, light = str(rng.choice(list(PATHS))), str(rng.choice(LIGHT))
    kind = KINDS[int(rng.integers(len(KINDS)))]
    snr = math.exp(rng.uniform(*np.log(_SNR)))
    count = int(rng.integers(_FRAMES[0], _FRAMES[1] + 1))
    empty = int(rng.choice(_EMPTY))
    low = math.exp(rng.uniform(math.log(0.1), math.log(0.4)))
    high = low * math.exp(rng.uniform(math.log(2.0), math.log(6.0)))
    inside = math.exp(1e-3 * math.log(high / low))
    ranges = PATHS[path](low * inside, high / inside, count, rng)
    optics, known = rng.random() < _OPTICS, rng.random() < _KNOWN
    make = _through_optics if optics else _of_model
    made = make(kind, light, known, snr, ranges, math.sqrt(low * high), empty, rng)
    step = max(float(np.sqrt(np.mean(np.diff(np.log(ranges)) ** 2))), 1e-3)
    present = np.arange(count + empty) >= empty
    frames = Frames(
        made.frames.readings,
        time_s=step * np.arange(count + empty, dtype=np.float64),
        object_present=present if empty else None,
    )
    told_of = "known" if known else "unknown"
    name = f"{made.name}, {told_of}, {light}, {path}, SNR {snr:.0f}, {count} frames, {empty} empty"
    return dataclasses.replace(made, name=name, frames=frames)


def fitted_object(plate: PlateScene, radius: float) -> dict[str, float] | None:
    """Return c0, c1, c2 of a surface as a calibration finds them; None where it finds none.

    Parameters
    ----------
    plate, radius : PlateScene, float
        As `benchmarks.coverage.classes.surface` has them.
    """
    light, ranges = [], []
    for distance in np.geomspace(*_CALIBRATED_M, 40).tolist():
        scene = OpticalScene(surfaces=(at(plate, radius, distance),))
        first, second = read(scene, _SILENT, tolerance=1e-6).mean
        light.append(second)
        ranges.append(_SILENT.max_range_m * first / second)
    fit = fit_object(np.array(ranges), np.array(light))
    if not (fit.c0 > 0 and fit.c2 > 0 and fit.c1 > -2 * math.sqrt(fit.c0)):
        return None
    return {"c0": fit.c0, "c1": fit.c1, "c2": fit.c2}


def _crosstalk(light: str, middle: float, known: bool, rng: np.random.Generator) -> _Light:
    """Draw crosstalk, and what is told of it."""
    if light not in ("crosstalk", "both"):
        return _Light(None, None, {})
    size = middle * math.exp(rng.uniform(math.log(0.01), 0.0))
    values = (size * rng.standard_normal(2)).tolist()
    sd = min(size * float(rng.choice(_TOLD)), max(size, _WIDEST * middle))
    if known and rng.random() < 0.5:
        return _Light(values, None, {"crosstalk": values})
    return _Light(values, None, {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": sd}] * 2})


def _strength_prior(strength: float, rng: np.random.Generator) -> dict[str, Any]:
    median = strength * math.exp(0.5 * rng.standard_normal())
    return {"prior": "lognormal", "median": median, "sigma": 0.5}


def _sensor(kind: Mapping[str, Any], noise: float) -> Sensor:
    return parse_sensor({**kind, "noise": {"read": [noise, noise]}})


def _of_model(
    kind: Mapping[str, Any],
    light: str,
    known: bool,
    snr: float,
    ranges: Array,
    middle_m: float,
    empty: int,
    rng: np.random.Generator,
) -> RandomSet:
    """Make readings of an object of the model, with a smooth error."""
    c0 = 0.08 * math.exp(0.7 * rng.standard_normal())
    c1 = 2 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
    c2 = 0.1 * math.exp(0.5 * rng.standard_normal())
    thing = {"c0": c0, "c1": c1, "c2": c2}
    middle = float(object_flux(middle_m, c0 * c2, c0, c1))
    other = _crosstalk(light, middle, known, rng)
    error = DISCREPANCY_SD * (FITTED_SHARE if known else 1.0)
    made: dict[str, Any] = {
        "object": thing,
        "discrepancy": {"flux": error, "range_m": RANGE_ERROR_SD},
    }
    told: dict[str, Any] = dict(other.told) | ({"object": thing} if known else {})
    truth = {} if known else {f"object.{name}": value for name, value in thing.items()}
    if other.crosstalk is not None:
        made["crosstalk"] = other.crosstalk
        columns = ("w1", "w2") if kind["kind"] == "pulsed" else ("i", "q")
        truth |= {f"crosstalk.{c}": v for c, v in zip(columns, other.crosstalk, strict=True)}
    if light in ("background", "both"):
        strength, distance = float(middle * rng.uniform(0.3, 1.0)), float(rng.uniform(3.0, 6.0))
        shadow = {
            "c0": c0 * 0.75 * math.exp(0.5 * rng.standard_normal()),
            "c1": 0.3 * math.sqrt(c0) * abs(float(rng.standard_normal())),
        }
        wall = {"strength": strength, "distance_m": distance, "shadow": shadow}
        made["background"] = wall
        prior = _strength_prior(strength, rng)
        whole = known and rng.random() < 0.5
        told["background"] = wall if whole else {"strength": prior, "distance_m": distance}
        truth |= {"background.strength": strength}
        truth |= {f"background.shadow.{name}": value for name, value in shadow.items()}
    sensor = _sensor(kind, middle / snr)
    path = SampledTrajectory(
        range_m=[1.0] * empty + ranges.tolist(),
        object_present=[False] * empty + [True] * ranges.size,
    )
    seen = simulate(sensor, parse_scene(made), path, rng)
    return RandomSet("model", sensor, seen.frames, told, seen.range_m, truth)


def _through_optics(
    kind: Mapping[str, Any],
    light: str,
    known: bool,
    snr: float,
    ranges: Array,
    middle_m: float,
    empty: int,
    rng: np.random.Generator,
) -> RandomSet:
    """Make readings of a surface as exact optics has them."""
    group = CLASSES["crosstalk"]  # any surface
    while True:
        name, plate, radius = surface(group, rng)
        thing = fitted_object(plate, radius) if known else None
        if not known or thing is not None:
            break
    silent = _sensor(kind, 1.0)
    bare = OpticalScene(surfaces=(at(plate, radius, middle_m),))
    middle = float(np.hypot(*read(bare, silent, tolerance=1e-6).mean))
    other = _crosstalk(light, middle, known, rng)
    sensor = _sensor(kind, middle / snr)
    told: dict[str, Any] = dict(other.told) | ({"object": thing} if known else {})
    scene = OpticalScene(surfaces=(at(plate, radius, 1.0),))
    truth: dict[str, float] = {}
    if other.crosstalk is not None:
        first, second = other.crosstalk
        scene = scene.model_copy(update={"electronics": Electronics(crosstalk=(first, second))})
        columns = ("w1", "w2") if kind["kind"] == "pulsed" else ("i", "q")
        truth = {f"crosstalk.{c}": v for c, v in zip(columns, other.crosstalk, strict=True)}
    if light in ("background", "both"):
        distance = float(rng.uniform(3.0, 6.0))
        scene = scene.model_copy(update={"background": Shell(radius_m=distance)})
        wall = read(OpticalScene(background=Shell(radius_m=distance)), silent, tolerance=1e-6).mean
        strength = wall[1] if kind["kind"] == "pulsed" else float(np.hypot(*wall))
        prior = _strength_prior(strength, rng)
        told["background"] = {"strength": prior, "distance_m": distance, "shadow": SHADOW}
        truth["background.strength"] = strength
    seen = series(scene, lambda d: at(plate, radius, d).pose, ranges, sensor, rng)
    without = scene.model_copy(update={"surfaces": ()})
    dark = [read(without, sensor, rng).values for _ in range(empty)]
    readings = np.concatenate([np.array(dark).reshape(-1, 2), seen.frames.readings])
    range_m = np.concatenate([np.full(empty, np.nan), seen.range_m])
    return RandomSet(name, sensor, Frames(readings), told, range_m, truth)
