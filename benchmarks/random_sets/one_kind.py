"""Random sets of one kind alone: hard scenes, and scenes of which one fact is stated wrongly.

Pulses of 30 to 100 ns or waves of 5 to 20 MHz; 15 or 20 frames at even steps of range, of an object
of the model with a smooth error as large as stands by default. A fact that is stated wrongly should
be a misfit where readings tell it; where they do not, ranges are wrong with it.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.paths import PathSet, shadow_of
from benchmarks.random_sets.wide import between
from simulator.discrepancy import DISCREPANCY_SD
from simulator.model_error import FITTED_SHARE, RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = ["KINDS", "kind_of_set"]

Array = NDArray[np.float64]

_WIDTHS_S, _FREQUENCIES_HZ = (3e-8, 1e-7), (5e6, 2e7)
_CROSSTALK = (0.03, 1.0)  # over the light in the middle
_WALL, _BEHIND = (
    (0.1, 2.0),
    (1.2, 3.0),
)  # strength over that light, distance over the farthest range
_RULED, _RULER_M = 6, 1e-3


class _Wanted(NamedTuple):
    """What is drawn of a set.

    ``light`` is crosstalk or a wall, of which ``strength`` and distance are then known; ``worse``
    how many times its standard deviation a ruler errs, 0 for no rulers.
    """

    ranges: Array
    snr: float
    light: str = "crosstalk"
    known: bool = False
    empty: int = 0
    worse: float = 0.0
    large: bool = False


def kind_of_set(kind: str, seed: int, number: int) -> PathSet:
    """Draw a set of one kind.

    Parameters
    ----------
    kind : str
        Of `KINDS`.
    seed, number : int
        Of the study, a fresh one every time, and of the set in it.

    Returns
    -------
    PathSet
    """
    return KINDS[kind](np.random.default_rng([seed, number, 3]))


def _stroke(count: int, rng: np.random.Generator) -> Array:
    low = between((0.15, 0.5), rng)
    return np.linspace(low, low * between((2.0, 6.0), rng), count)


def _thing(large: bool, rng: np.random.Generator) -> dict[str, float]:
    if large:
        c0 = between((0.3, 1.5), rng)
        c1 = math.sqrt(c0) * float(rng.uniform(-0.5, 0.8))
    else:
        c0 = 0.08 * math.exp(0.7 * rng.standard_normal())
        c1 = 2 * math.sqrt(c0) * math.expm1(0.4 * rng.standard_normal())
    return {"c0": c0, "c1": c1, "c2": 0.1 * math.exp(0.5 * rng.standard_normal())}


def _drawn(wanted: _Wanted, rng: np.random.Generator) -> PathSet:
    """Draw a set whose scene states nothing wrong."""
    ranges, pulsed = wanted.ranges, bool(rng.random() < 0.5)
    kind: dict[str, Any] = {"kind": "sine_wave", "frequency_hz": between(_FREQUENCIES_HZ, rng)}
    if pulsed:
        kind = {"kind": "pulsed", "pulse_width_s": between(_WIDTHS_S, rng)}
    thing = _thing(wanted.large, rng)
    middle = math.sqrt(float(ranges.min() * ranges.max()))
    light = float(object_flux(middle, thing["c0"] * thing["c2"], thing["c0"], thing["c1"]))
    error = DISCREPANCY_SD * (FITTED_SHARE if wanted.known else 1.0)
    made: dict[str, Any] = {
        "object": thing,
        "discrepancy": {"flux": error, "range_m": RANGE_ERROR_SD},
    }
    told: dict[str, Any] = {"object": thing} if wanted.known else {}
    truth = {} if wanted.known else {f"object.{name}": value for name, value in thing.items()}
    if wanted.light == "crosstalk":
        size = light * between(_CROSSTALK, rng)
        values = (size * rng.standard_normal(2)).tolist()
        if pulsed:  # light that a glass sends back: more in all than in the late window
            values = sorted(abs(value) for value in values)
        made["crosstalk"] = values
        told["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": size}] * 2
        columns = ("w1", "w2") if pulsed else ("i", "q")
        truth |= {f"crosstalk.{name}": v for name, v in zip(columns, values, strict=True)}
    else:
        strength = light * between(_WALL, rng)
        distance = float(ranges.max()) * between(_BEHIND, rng)
        shadow = shadow_of(thing["c0"], rng)
        made["background"] = {"strength": strength, "distance_m": distance, "shadow": shadow}
        told["background"] = {"strength": strength, "distance_m": distance}
        truth |= {f"background.shadow.{name}": value for name, value in shadow.items()}
    ruler: list[float | None] | None = None
    if wanted.worse:
        ruled = rng.choice(ranges.size, _RULED, replace=False)
        of_frames = np.isin(np.arange(-wanted.empty, ranges.size), ruled).tolist()
        ruler = [_RULER_M * wanted.worse if one else None for one in of_frames]
    read = light / wanted.snr
    sensor = parse_sensor({**kind, "noise": {"read": [read, read * between((0.5, 2.0), rng)]}})
    path = SampledTrajectory(
        range_m=[1.0] * wanted.empty + ranges.tolist(),
        object_present=[False] * wanted.empty + [True] * ranges.size,
        known_range_sd_m=ruler,
    )
    seen = simulate(sensor, parse_scene(made), path, rng)
    name = f"{kind['kind']}, SNR {wanted.snr:.0f}, {ranges.min():.2f}-{ranges.max():.2f} m"
    return PathSet(name, sensor, seen.frames, told, seen.range_m, truth)


def _very_near(rng: np.random.Generator) -> PathSet:
    """Draw a large object right before the sensor."""
    ranges = np.linspace(0.05, 0.4, 20)
    return _drawn(_Wanted(ranges, between((1e2, 1e5), rng), empty=5, large=True), rng)


def _strength_known(rng: np.random.Generator) -> PathSet:
    """Draw an unknown object before a wall of known strength and distance."""
    return _drawn(_Wanted(_stroke(15, rng), between((30.0, 1e5), rng), light="wall"), rng)


def _two_places(rng: np.random.Generator) -> PathSet:
    """Draw frames in two places, none of them empty."""
    ends = _stroke(2, rng)
    ranges = np.repeat(ends, 10) * (1.0 + 0.02 * rng.standard_normal(20))
    return _drawn(_Wanted(ranges, between((30.0, 3e4), rng)), rng)


def _other_light(rng: np.random.Generator) -> PathSet:
    """Draw a known object that is a fifth darker than it is said to be."""
    data = _drawn(_Wanted(_stroke(20, rng), between((30.0, 1e4), rng), known=True), rng)
    thing = data.scene["object"]
    return _told(data, {"object": {**thing, "c2": 1.2 * thing["c2"]}})


def _other_crosstalk(rng: np.random.Generator) -> PathSet:
    """Draw crosstalk of which the numbers that are told are a tenth too large."""
    data = _drawn(_Wanted(_stroke(15, rng), between((30.0, 1e4), rng)), rng)
    values = [1.1 * v for name, v in data.parameters.items() if name.startswith("crosstalk")]
    return _told(data, {"crosstalk": values})


def _narrow_prior(rng: np.random.Generator) -> PathSet:
    """Draw crosstalk ten times as large as its prior says."""
    data = _drawn(_Wanted(_stroke(15, rng), between((30.0, 1e4), rng)), rng)
    priors = [{**prior, "sd": 0.1 * prior["sd"]} for prior in data.scene["crosstalk"]]
    return _told(data, {"crosstalk": priors})


def _worse_rulers(rng: np.random.Generator) -> PathSet:
    """Draw six rulers of 1 mm that are off by 3 mm."""
    data = _drawn(_Wanted(_stroke(20, rng), between((30.0, 1e4), rng), worse=3.0), rng)
    told = data.frames.known_range_sd_m
    assert told is not None  # six are
    return dataclasses.replace(
        data, frames=dataclasses.replace(data.frames, known_range_sd_m=told / 3.0)
    )


def _told(data: PathSet, other: dict[str, Any]) -> PathSet:
    """Return a set of which a scene tells something else."""
    unknown = {n: v for n, v in data.parameters.items() if n.split(".")[0] not in other}
    return dataclasses.replace(data, scene=data.scene | other, parameters=unknown)


KINDS: Mapping[str, Callable[[np.random.Generator], PathSet]] = {
    "very-near": _very_near,
    "strength-known": _strength_known,
    "two-places": _two_places,
    "other-light": _other_light,
    "other-crosstalk": _other_crosstalk,
    "narrow-prior": _narrow_prior,
    "worse-rulers": _worse_rulers,
}
"""By name: three hard scenes that state nothing wrong, and four that do."""
