"""Random sets: a sensor, an object on its way, light that is not known, and what is told of it."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.calibrated_object import calibrated_object
from benchmarks.coverage.classes import CLASSES, KINDS, SHADOW, at, surface
from benchmarks.coverage.paths import LIGHT, PATHS, PathSet, lognormal_about, shadow_of
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.optics.assembly import OpticalScene, read
from simulator.optics.electronics import Electronics
from simulator.optics.motion import series
from simulator.optics.surfaces import Shell
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["random_set"]

Array = NDArray[np.float64]

_OPTICS = 1 / 3  # share of sets whose light is that of exact optics
_KNOWN = 0.5  # share in which the object is known
_SNR = (10.0, 1e5)
_FRAMES = (8, 40)
_EMPTY = (0, 0, 3, 6)
_TOLD = (1.0, 3.0, 10.0)  # standard deviation of the crosstalk that is told, over the true one
_WIDEST = 1.0  # of that in the signal in the middle of the stroke


class _Wanted(NamedTuple):
    """What is drawn of a set before its object."""

    kind: Mapping[str, Any]  # of the sensor
    light: str
    known: bool
    snr: float
    ranges: Array
    middle_m: float
    empty: int


class _Crosstalk(NamedTuple):
    """Crosstalk: what it is, what is told of it, and the truth by scene path."""

    values: list[float] | None
    told: dict[str, Any]
    truth: dict[str, float]


def random_set(seed: int, number: int) -> PathSet:
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
    PathSet
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
    made = make(_Wanted(kind, light, known, snr, ranges, math.sqrt(low * high), empty), rng)
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


def _crosstalk(wanted: _Wanted, middle: float, rng: np.random.Generator) -> _Crosstalk:
    """Draw crosstalk, and what is told of it."""
    if wanted.light not in ("crosstalk", "both"):
        return _Crosstalk(None, {}, {})
    size = middle * math.exp(rng.uniform(math.log(0.01), 0.0))
    values = (size * rng.standard_normal(2)).tolist()
    sd = min(size * float(rng.choice(_TOLD)), max(size, _WIDEST * middle))
    columns = _sensor(wanted.kind, 1.0).columns
    truth = {f"crosstalk.{c}": v for c, v in zip(columns, values, strict=True)}
    if wanted.known and rng.random() < 0.5:
        return _Crosstalk(values, {"crosstalk": values}, truth)
    prior = {"prior": "normal", "mean": 0.0, "sd": sd}
    return _Crosstalk(values, {"crosstalk": [prior] * 2}, truth)


def _sensor(kind: Mapping[str, Any], noise: float) -> Sensor:
    return parse_sensor({**kind, "noise": {"read": [noise, noise]}})


def _of_model(wanted: _Wanted, rng: np.random.Generator) -> PathSet:
    """Make readings of an object of the model, with a smooth error."""
    kind, light, known, snr, ranges, middle_m, empty = wanted
    c0 = 0.08 * math.exp(0.7 * rng.standard_normal())
    c1 = 2 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
    c2 = 0.1 * math.exp(0.5 * rng.standard_normal())
    thing = {"c0": c0, "c1": c1, "c2": c2}
    middle = float(object_flux(middle_m, c0 * c2, c0, c1))
    other = _crosstalk(wanted, middle, rng)
    error = DISCREPANCY_SD * (FITTED_SHARE if known else 1.0)
    made: dict[str, Any] = {
        "object": thing,
        "discrepancy": {"flux": error, "range_m": RANGE_ERROR_SD},
    }
    told: dict[str, Any] = dict(other.told) | ({"object": thing} if known else {})
    truth = {} if known else {f"object.{name}": value for name, value in thing.items()}
    truth |= other.truth
    if other.values is not None:
        made["crosstalk"] = other.values
    if light in ("background", "both"):
        strength, distance = float(middle * rng.uniform(0.3, 1.0)), float(rng.uniform(3.0, 6.0))
        shadow = shadow_of(c0, rng)
        wall = {"strength": strength, "distance_m": distance, "shadow": shadow}
        made["background"] = wall
        prior = lognormal_about(strength, 0.5, rng)
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
    return PathSet("model", sensor, seen.frames, told, seen.range_m, truth)


def _through_optics(wanted: _Wanted, rng: np.random.Generator) -> PathSet:
    """Make readings of a surface as exact optics has them."""
    kind, light, known, snr, ranges, middle_m, empty = wanted
    group = CLASSES["crosstalk"]  # any surface
    while True:
        name, plate, radius = surface(group, rng)
        thing = calibrated_object(plate, radius) if known else None
        if not known or thing is not None:
            break
    silent = _sensor(kind, 1.0)
    bare = OpticalScene(surfaces=(at(plate, radius, middle_m),))
    middle = float(np.hypot(*read(bare, silent, tolerance=1e-6).mean))
    other = _crosstalk(wanted, middle, rng)
    sensor = _sensor(kind, middle / snr)
    told: dict[str, Any] = dict(other.told) | ({"object": thing} if known else {})
    scene = OpticalScene(surfaces=(at(plate, radius, 1.0),))
    truth = dict(other.truth)
    if other.values is not None:
        first, second = other.values
        scene = scene.model_copy(update={"electronics": Electronics(crosstalk=(first, second))})
    if light in ("background", "both"):
        distance = float(rng.uniform(3.0, 6.0))
        scene = scene.model_copy(update={"background": Shell(radius_m=distance)})
        wall = read(OpticalScene(background=Shell(radius_m=distance)), silent, tolerance=1e-6).mean
        strength = wall[1] if kind["kind"] == "pulsed" else float(np.hypot(*wall))
        prior = lognormal_about(strength, 0.5, rng)
        told["background"] = {"strength": prior, "distance_m": distance, "shadow": SHADOW}
        truth["background.strength"] = strength
    seen = series(scene, lambda d: at(plate, radius, d).pose, ranges, sensor, rng)
    without = scene.model_copy(update={"surfaces": ()})
    dark = [read(without, sensor, rng).values for _ in range(empty)]
    readings = np.concatenate([np.array(dark).reshape(-1, 2), seen.frames.readings])
    range_m = np.concatenate([np.full(empty, np.nan), seen.range_m])
    return PathSet(name, sensor, Frames(readings), told, range_m, truth)
