"""Wide random sets: sensors, noises, scenes and numbers of frames far from those of studies.

What is told of a set may be anything between all and nothing, and what it does not tell is drawn
from the priors that it states or leaves to their defaults, but for c0, which is nearer its middle.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from benchmarks.coverage.paths import LIGHT, PATHS, PathSet, lognormal_about, shadow_of
from simulator.discrepancy import DISCREPANCY_SD
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["between", "uneven_set", "wide_set"]

_LIGHT_SPEED = 299792458.0
_WIDTHS_S, _FREQUENCIES_HZ = (2e-8, 3e-7), (1e6, 4e7)
_SNR = (3.0, 1e6)  # in the stroke's middle
_EVEN, _UNEVEN = (0.3, 3.0), (0.01, 100.0)  # read noise of the second reading over the first's
_FRAMES = (2, 120)
_EMPTY = (0, 0, 1, 5, 20)
_NEAREST_M, _STROKE = (0.05, 0.8), (1.2, 10.0)
_GAIN = (1e-3, 1e6)
_RULED = 0.15  # share of sets in which some ranges are known
_RULER_M = (1e-3, 2e-2)
_TOLD_OF_OBJECT = ("nothing", "nothing", "all", "c2", "shape", "roughly")
_TOLD_OF_CROSSTALK = ("normal", "uniform", "near", "halfnormal", "one known")


class _Part(NamedTuple):
    """A part of a scene: as it is, as it is told, and the truth of what is not known of it."""

    is_: Any
    told: Any
    truth: dict[str, float]


def uneven_set(seed: int, number: int) -> PathSet:
    """Draw a wide set of which one reading may have a hundred times the other's noise.

    A late window that is read out for longer, or another amplifier behind each window.

    Parameters
    ----------
    seed, number : int
        As of `wide_set`; all else of the set is as there.

    Returns
    -------
    PathSet
    """
    return wide_set(seed, number, ratio=_UNEVEN)


def wide_set(seed: int, number: int, *, ratio: tuple[float, float] = _EVEN) -> PathSet:
    """Draw a set of the object model with a smooth error as large as stands by default.

    Pulses of 20 to 300 ns and waves of 1 to 40 MHz; a gain of 1e-3 to 1e6; read noise that differs
    between the readings, in some sets with shot noise or a relative error; 2 to 120 frames, none to
    20 empty ones; a path of `benchmarks.coverage.paths` from 5 to 80 cm to 1.2 to 10 times as far;
    a signal-to-noise ratio of 3 to 1e6 in its middle. The object is known, or not, or its c2, its
    c0 and c1, or roughly. Crosstalk is up to three times the light in the middle, told by one of
    five priors; a wall is 1.1 to 6 times as far as the stroke, its distance and strength known or
    not. In some sets a few ranges are known to 1 to 20 mm.

    Parameters
    ----------
    seed, number : int
        Of the study, a fresh one every time, and of the set in it.
    ratio : tuple of float
        Least and greatest read noise of the second reading over that of the first.

    Returns
    -------
    PathSet
    """
    rng = np.random.default_rng([seed, number, 1])
    pulsed = rng.random() < 0.5
    if pulsed:
        width = between(_WIDTHS_S, rng)
        kind: dict[str, Any] = {"kind": "pulsed", "pulse_width_s": width}
        reach = 0.5 * _LIGHT_SPEED * width
    else:
        frequency = between(_FREQUENCIES_HZ, rng)
        kind = {"kind": "sine_wave", "frequency_hz": frequency}
        reach = 0.5 * _LIGHT_SPEED / frequency
    path, light = str(rng.choice(list(PATHS))), str(rng.choice(LIGHT))
    snr = between(_SNR, rng)
    count, empty = round(between(_FRAMES, rng)), int(rng.choice(_EMPTY))
    low = min(between(_NEAREST_M, rng), 0.25 * reach)
    high = min(low * between(_STROKE, rng), 0.6 * reach)
    inside = math.exp(1e-3 * math.log(high / low))
    ranges = PATHS[path](low * inside, high / inside, count, rng)
    thing = _object(rng)
    c0, c1, c2 = (thing.is_[name] for name in ("c0", "c1", "c2"))
    gain = between(_GAIN, rng)
    middle = gain * float(object_flux(math.sqrt(low * high), c0 * c2, c0, c1))
    parts = {"object": thing}
    if light in ("crosstalk", "both"):
        parts["crosstalk"] = _crosstalk(("w1", "w2") if pulsed else ("i", "q"), middle, rng)
    if light in ("background", "both"):
        parts["background"] = _background(middle, high, reach, c0, rng)
    error = DISCREPANCY_SD * (1.0 if thing.truth else FITTED_SHARE)
    made = {name: part.is_ for name, part in parts.items()}
    made["discrepancy"] = {"flux": error, "range_m": RANGE_ERROR_SD}
    noise = _noise(middle, snr, ratio, rng)
    step = max(float(np.sqrt(np.mean(np.diff(np.log(ranges)) ** 2))), 1e-3)
    ruled, no_object = _ruled(count, rng), list[float | None]([None] * empty)
    trajectory = SampledTrajectory(
        range_m=[1.0] * empty + ranges.tolist(),
        object_present=[False] * empty + [True] * count,
        time_s=(step * np.arange(count + empty)).tolist(),
        known_range_sd_m=no_object + ruled if any(ruled) else None,
    )
    sensor = parse_sensor({**kind, "gain": gain, "noise": noise})
    seen = simulate(sensor, parse_scene(made), trajectory, rng)
    unknown = ", ".join(name.removeprefix("object.") for name in thing.truth) or "nothing"
    name = (
        f"{kind['kind']} to {reach:.1f} m, {unknown} unknown, {light}, {path}, SNR {snr:.3g}, "
        f"{' + '.join(noise)}, {low:.2f}-{high:.2f} m, {count} frames, {empty} empty, "
        f"{sum(sd is not None for sd in ruled)} ruled"
    )
    told = {name: part.told for name, part in parts.items() if part.told}
    truth = {name: value for part in parts.values() for name, value in part.truth.items()}
    return PathSet(name, sensor, seen.frames, told, seen.range_m, truth)


def between(ends: tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a number whose logarithm is uniform between two ends."""
    return math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))


def _object(rng: np.random.Generator) -> _Part:
    knowing = str(rng.choice(_TOLD_OF_OBJECT))
    c0 = 0.1 * math.exp(1.2 * rng.standard_normal())
    c1 = 2 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
    c2 = 0.1 * math.exp(rng.standard_normal())
    is_ = {"c0": c0, "c1": c1, "c2": c2}
    numbers = {"all": ("c0", "c1", "c2"), "c2": ("c2",), "shape": ("c0", "c1")}.get(knowing, ())
    told: dict[str, Any] = {name: is_[name] for name in numbers}
    if knowing == "roughly":
        told = {"c0": lognormal_about(c0, 0.3, rng), "c2": lognormal_about(c2, 0.1, rng)}
    return _Part(is_, told, {f"object.{k}": v for k, v in is_.items() if k not in numbers})


def _crosstalk(columns: tuple[str, str], middle: float, rng: np.random.Generator) -> _Part:
    size = middle * between((1e-3, 3.0), rng)
    values = (size * rng.standard_normal(2)).tolist()
    way = str(rng.choice(_TOLD_OF_CROSSTALK))
    normal = {"prior": "normal", "mean": 0.0, "sd": size}
    told: list[Any] = [normal, normal]
    if way == "halfnormal":
        values = [abs(value) for value in values]
        told = [{"prior": "halfnormal", "sd": size}] * 2
    elif way == "uniform":
        values = rng.uniform(-size, size, 2).tolist()
        told = [{"prior": "uniform", "low": -size, "high": size}] * 2
    elif way == "near":
        sd = 0.05 * size
        means = [value + sd * rng.standard_normal() for value in values]
        told = [{"prior": "normal", "mean": mean, "sd": sd} for mean in means]
    elif way == "one known":
        told = [values[0], normal]
    of_each = zip(columns, values, told, strict=True)
    truth = {f"crosstalk.{name}": value for name, value, t in of_each if isinstance(t, dict)}
    return _Part(values, told, truth)


def _background(
    middle: float, high: float, reach: float, c0: float, rng: np.random.Generator
) -> _Part:
    strength = middle * between((0.05, 2.0), rng)
    distance = max(min(high * between((1.1, 6.0), rng), 0.95 * reach), 1.02 * high)
    shadow = shadow_of(c0, rng)
    is_ = {"strength": strength, "distance_m": distance, "shadow": shadow}
    told: dict[str, Any] = {"strength": strength, "distance_m": distance}
    truth = {f"background.shadow.{name}": value for name, value in shadow.items()}
    if rng.random() < 0.7:
        told["strength"] = lognormal_about(strength, 0.5, rng)
        truth["background.strength"] = strength
    if rng.random() < 0.5:
        told["distance_m"] = lognormal_about(distance, 0.02, rng)
        truth["background.distance_m"] = distance
    return _Part(is_, told, truth)


def _noise(
    middle: float, snr: float, ratio: tuple[float, float], rng: np.random.Generator
) -> dict[str, Any]:
    read = middle / snr
    law: dict[str, Any] = {"read": [read, read * between(ratio, rng)]}
    if rng.random() < 0.4:
        law["shot"] = read * read / middle * between((0.1, 10.0), rng)
    if rng.random() < 0.25:
        law["relative"] = between((1e-4, 0.03), rng)
    return law


def _ruled(count: int, rng: np.random.Generator) -> list[float | None]:
    """Draw which ranges are known, and how well."""
    ruled: list[float | None] = [None] * count
    if rng.random() < _RULED:
        sd = between(_RULER_M, rng)
        for i in rng.choice(count, min(count, int(rng.integers(1, 6))), replace=False).tolist():
            ruled[i] = sd
    return ruled
