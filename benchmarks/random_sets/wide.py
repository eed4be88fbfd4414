"""Wide random sets: sensors, noises, and scenes of all kinds, of which more or less is known."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.paths import LIGHT, PATHS, PathSet
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["wide_set"]

Array = NDArray[np.float64]

_SNR = (3.0, 1e6)
_FRAMES = (2, 120)
_EMPTY = (0, 0, 1, 5, 20)
_RULED = 0.15  # share of sets in which some ranges are known
_KNOWN = ("nothing", "nothing", "all", "c2", "shape", "roughly")


class _Told(NamedTuple):
    """A part of a scene: as it is, as it is told, and the truth by scene path."""

    is_: dict[str, Any]
    told: dict[str, Any]
    truth: dict[str, float]


def wide_set(seed: int, number: int) -> PathSet:
    """Draw a set of the object model with a smooth error as large as stands by default.

    Parameters
    ----------
    seed, number : int
        Of the study, a fresh one every time, and of the set in it.

    Returns
    -------
    PathSet
    """
    rng = np.random.default_rng([seed, number, 1])

    def between(low: float, high: float) -> float:
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    pulsed = rng.random() < 0.5
    if pulsed:
        width = between(2e-8, 3e-7)
        kind: dict[str, Any] = {"kind": "pulsed", "pulse_width_s": width}
        reach = 0.5 * 299792458.0 * width
    else:
        frequency = between(1e6, 4e7)
        kind = {"kind": "sine_wave", "frequency_hz": frequency}
        reach = 0.5 * 299792458.0 / frequency
    path, light = str(rng.choice(list(PATHS))), str(rng.choice(LIGHT))
    snr = between(*_SNR)
    count, empty = round(between(*_FRAMES)), int(rng.choice(_EMPTY))
    low = min(between(0.05, 0.8), 0.25 * reach)
    high = min(low * between(1.2, 10.0), 0.6 * reach)
    inside = math.exp(1e-3 * math.log(high / low))
    ranges = PATHS[path](low * inside, high / inside, count, rng)
    middle_m = math.sqrt(low * high)
    thing = _object(rng)
    c0, c1, c2 = thing.is_["c0"], thing.is_["c1"], thing.is_["c2"]
    gain = between(1e-3, 1e6)
    middle = gain * float(object_flux(middle_m, c0 * c2, c0, c1))
    columns = ("w1", "w2") if pulsed else ("i", "q")
    parts = [thing]
    if light in ("crosstalk", "both"):
        parts.append(_crosstalk(columns, middle, rng))
    if light in ("background", "both"):
        parts.append(_background(middle, high, reach, (c0, c1), rng))
    known = len(thing.truth) == 0
    error = DISCREPANCY_SD * (FITTED_SHARE if known else 1.0)
    made: dict[str, Any] = {"discrepancy": {"flux": error, "range_m": RANGE_ERROR_SD}}
    told: dict[str, Any] = {}
    truth: dict[str, float] = {}
    for name, part in zip(("object", "crosstalk", "background"), _by_name(parts, light), strict=True):
        if part is None:
            continue
        made[name] = part.is_ if name != "crosstalk" else part.is_["values"]
        if part.told:
            told[name] = part.told if name != "crosstalk" else part.told["values"]
        truth |= part.truth
    sensor, noise = _sensor({**kind, "gain": gain}, middle, snr, rng)
    ruled = [None] * (count + empty)
    if rng.random() < _RULED:
        sd = between(1e-3, 2e-2)
        which = rng.choice(count, min(count, int(rng.integers(1, 6))), replace=False)
        for i in which:
            ruled[empty + int(i)] = sd
    step = max(float(np.sqrt(np.mean(np.diff(np.log(ranges)) ** 2))), 1e-3)
    trajectory = SampledTrajectory(
        range_m=[1.0] * empty + ranges.tolist(),
        object_present=[False] * empty + [True] * count,
        time_s=(step * np.arange(count + empty)).tolist(),
        known_range_sd_m=ruled if any(ruled) else None,
    )
    seen = simulate(sensor, parse_scene(made), trajectory, rng)
    saying = "/".join(sorted(thing.truth)) or "known"
    name = (
        f"{'pulse' if pulsed else 'wave'} reach {reach:.1f} m, {saying.replace('object.', '')} unknown, {light}, {path}, "
        f"SNR {snr:.3g}, {noise}, {low:.2f}-{high:.2f} m, {count} frames, {empty} empty, {sum(x is not None for x in ruled)} ruled"
    )
    return PathSet(name, sensor, seen.frames, told, seen.range_m, truth)


def _by_name(parts: list[_Told], light: str) -> list[_Told | None]:
    crosstalk = parts[1] if light in ("crosstalk", "both") else None
    background = parts[-1] if light in ("background", "both") else None
    return [parts[0], crosstalk, background]


def _object(rng: np.random.Generator) -> _Told:
    """Draw an object from the default priors, and how much of it is told."""
    knowing = str(rng.choice(_KNOWN))
    c0 = 0.1 * math.exp(1.2 * rng.standard_normal())
    c1 = 2 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
    c2 = 0.1 * math.exp(rng.standard_normal())
    is_ = {"c0": c0, "c1": c1, "c2": c2}
    told: dict[str, Any]
    if knowing == "all":
        told = dict(is_)
    elif knowing == "c2":
        told = {"c2": c2}
    elif knowing == "shape":
        told = {"c0": c0, "c1": c1}
    elif knowing == "roughly":
        told = {
            "c0": {"prior": "lognormal", "median": c0 * math.exp(0.3 * rng.standard_normal()), "sigma": 0.3},
            "c2": {"prior": "lognormal", "median": c2 * math.exp(0.1 * rng.standard_normal()), "sigma": 0.1},
        }
    else:
        told = {}
    truth = {f"object.{k}": v for k, v in is_.items() if not isinstance(told.get(k), float)}
    return _Told(is_, told, truth)


def _crosstalk(columns: tuple[str, str], middle: float, rng: np.random.Generator) -> _Told:
    size = middle * math.exp(rng.uniform(math.log(1e-3), math.log(3.0)))
    values = (size * rng.standard_normal(2)).tolist()
    told: list[Any] = []
    for value in values:
        way = str(rng.choice(["number", "normal", "uniform", "near"])) if False else ""
        told.append(value)
    way = str(rng.choice(["normal", "uniform", "near", "halfnormal", "one known"]))
    if way == "halfnormal":
        values = [abs(v) for v in values]
        told = [{"prior": "halfnormal", "sd": size}] * 2
    elif way == "normal":
        told = [{"prior": "normal", "mean": 0.0, "sd": size}] * 2
    elif way == "uniform":
        values = rng.uniform(-size, size, 2).tolist()
        told = [{"prior": "uniform", "low": -size, "high": size}] * 2
    elif way == "near":
        told = [{"prior": "normal", "mean": v + 0.05 * size * rng.standard_normal(), "sd": 0.05 * size} for v in values]
    else:
        told = [values[0], {"prior": "normal", "mean": 0.0, "sd": size}]
    truth = {
        f"crosstalk.{c}": v
        for c, v, t in zip(columns, values, told, strict=True)
        if isinstance(t, dict)
    }
    return _Told({"values": values}, {"values": told}, truth)


def _background(middle: float, high: float, reach: float, shape: tuple[float, float], rng: np.random.Generator) -> _Told:
    c0, _ = shape
    strength = middle * math.exp(rng.uniform(math.log(0.05), math.log(2.0)))
    distance = high * math.exp(rng.uniform(math.log(1.1), math.log(6.0)))
    distance = min(distance, 0.95 * reach)
    distance = max(distance, 1.02 * high)
    shadow = {
        "c0": c0 * 0.75 * math.exp(0.5 * rng.standard_normal()),
        "c1": 0.3 * math.sqrt(c0) * abs(float(rng.standard_normal())),
    }
    is_ = {"strength": strength, "distance_m": distance, "shadow": shadow}
    told: dict[str, Any] = {"strength": strength, "distance_m": distance}
    truth = {f"background.shadow.{k}": v for k, v in shadow.items()}
    if rng.random() < 0.7:
        median = strength * math.exp(0.5 * rng.standard_normal())
        told["strength"] = {"prior": "lognormal", "median": median, "sigma": 0.5}
        truth["background.strength"] = strength
    if rng.random() < 0.5:
        mean = distance * math.exp(0.02 * rng.standard_normal())
        told["distance_m"] = {"prior": "lognormal", "median": mean, "sigma": 0.02}
        truth["background.distance_m"] = distance
    return _Told(is_, told, truth)


def _sensor(kind: dict[str, Any], middle: float, snr: float, rng: np.random.Generator) -> tuple[Sensor, str]:
    noise = middle / snr
    read = [noise, noise * math.exp(rng.uniform(math.log(0.3), math.log(3.0)))]
    law: dict[str, Any] = {"read": read}
    said = "read"
    if rng.random() < 0.4:
        law["shot"] = noise * noise / middle * math.exp(rng.uniform(math.log(0.1), math.log(10.0)))
        said += "+shot"
    if rng.random() < 0.25:
        law["relative"] = math.exp(rng.uniform(math.log(1e-4), math.log(0.03)))
        said += "+relative"
    return parse_sensor({**kind, "noise": law}), said
