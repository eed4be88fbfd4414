"""Classes of paths: how an object gets from frame to frame, before light that is not known.

Inference is told no law of the ranges. Truth and scene agree in everything else, so that what an
interval misses is the doing of how ranges are spread.
"""

import dataclasses
import math
import zlib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.coverage.classes import KINDS
from simulator.discrepancy import DISCREPANCY_SD
from simulator.frames import Frames
from simulator.model_error import RANGE_ERROR_SD
from simulator.object_model import object_flux
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import simulate
from simulator.trajectories import SampledTrajectory

__all__ = [
    "LIGHT",
    "PATHS",
    "TOLD",
    "PathSet",
    "draw_path",
    "lognormal_about",
    "random_scene",
    "shadow_of",
]

Array = NDArray[np.float64]
Path = Callable[[float, float, int, np.random.Generator], Array]

FRAMES = 20
SNR = 300.0  # of the object in the middle of its stroke
LIGHT = ("object", "crosstalk", "background", "both")
_BEYOND = 1e-3  # of a stroke: so far inside its ends a walk stays


def _constant_speed(low: float, high: float, n: int, rng: np.random.Generator) -> Array:  # noqa: ARG001
    return np.linspace(low, high, n)


def _there_and_back(low: float, high: float, n: int, rng: np.random.Generator) -> Array:  # noqa: ARG001
    return np.asarray(high - (high - low) * np.abs(np.linspace(-1.0, 1.0, n)))


def _random_walk(low: float, high: float, n: int, rng: np.random.Generator) -> Array:
    """Walk in log r, reflected at the ends of the stroke, a fifth of it a frame."""
    a, b = np.log(low), np.log(high)
    u = rng.uniform(a, b) + np.cumsum(0.2 * (b - a) * rng.standard_normal(n))
    folded = np.mod(u - a, 2 * (b - a))
    return np.asarray(np.exp(a + np.minimum(folded, 2 * (b - a) - folded)))


def _at_rest_with_moves(low: float, high: float, n: int, rng: np.random.Generator) -> Array:
    """Four places, one after the other."""
    places = np.exp(rng.uniform(np.log(low), np.log(high), 4))
    places[:2] = low, high  # else the stroke would often be none
    return np.asarray(np.repeat(rng.permutation(places), -(-n // 4))[:n])


def _log_spaced(low: float, high: float, n: int, rng: np.random.Generator) -> Array:  # noqa: ARG001
    return np.geomspace(low, high, n)


def _clustered(low: float, high: float, n: int, rng: np.random.Generator) -> Array:
    """Nine frames in ten within a tenth of the stroke, the others anywhere in it."""
    a, b = np.log(low), np.log(high)
    start = rng.uniform(a, b - 0.1 * (b - a))
    u = np.where(np.arange(n) % 10 > 0, start + 0.1 * (b - a) * rng.random(n), rng.uniform(a, b, n))
    return np.asarray(np.exp(u))


def _independent(low: float, high: float, n: int, rng: np.random.Generator) -> Array:
    return np.asarray(np.exp(rng.uniform(np.log(low), np.log(high), n)))


PATHS: Mapping[str, Path] = {
    "constant speed": _constant_speed,
    "there and back": _there_and_back,
    "random walk": _random_walk,
    "at rest, a few moves": _at_rest_with_moves,
    "log-spaced": _log_spaced,
    "clustered": _clustered,
    "independent": _independent,
}


# what is stated besides the light, and the model's error that the readings are made with
TOLD: Mapping[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    "exact": ({"discrepancy": 0}, {}),
    "nothing": ({}, {"discrepancy": {"flux": DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}}),
    "nothing, larger errors": (
        {},
        {"discrepancy": {"flux": 5.0 * DISCREPANCY_SD, "range_m": RANGE_ERROR_SD}},
    ),
    "loguniform": (
        {"discrepancy": 0, "range_m": {"prior": "loguniform", "low": 0.02, "high": 15.0}},
        {},
    ),
}


@dataclasses.dataclass(frozen=True, eq=False)
class PathSet:
    """Readings of an object on its way, with the truth.

    Attributes
    ----------
    name : str
        What it is.
    sensor : Sensor
        The sensor.
    frames : Frames
        Its readings.
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


def shadow_of(c0: float, rng: np.random.Generator) -> dict[str, float]:
    """Draw c0' and c1' of a shadow from their default priors, of an object of that c0 [m^2]."""
    return {
        "c0": c0 * 0.75 * math.exp(0.5 * rng.standard_normal()),
        "c1": 0.3 * math.sqrt(c0) * abs(float(rng.standard_normal())),
    }


def lognormal_about(value: float, sigma: float, rng: np.random.Generator) -> dict[str, Any]:
    """Draw a lognormal prior that may well have made a value."""
    median = value * math.exp(sigma * rng.standard_normal())
    return {"prior": "lognormal", "median": median, "sigma": sigma}


def draw_path(path: str, light: str, told: str, number: int, snr: float = SNR) -> PathSet:
    """Draw a data set of a class of paths.

    The stroke starts at 0.1 to 0.4 m and ends 2 to 6 times as far. The object's c0 and c2 are
    within factors of about two of a plate's, and c1 is drawn from the default prior: of all of it
    inference is told nothing. Crosstalk is normal with a tenth of the signal in the stroke's
    middle, and inference is told three tenths; the strength of a background 3 to 6 m away is known
    to a factor exp(0.5), its shadow is as its default priors suppose.

    Parameters
    ----------
    path, light, told : str
        Of `PATHS`, `LIGHT` and `TOLD`.
    number : int
        Of the data set: it alone fixes everything. Even ones are pulsed, odd ones sine waves.
    snr : float
        Of the object in the middle of its stroke.

    Returns
    -------
    PathSet
    """
    rng = np.random.default_rng([zlib.crc32(f"{path}, {light}".encode()), number])
    return _data((path, light, told), KINDS[number % 2], FRAMES, snr, rng)


def random_scene(seed: int, number: int) -> PathSet:
    """Draw a path, a sensor, a number of frames, a signal-to-noise ratio and light at random.

    Parameters
    ----------
    seed, number : int
        Of the study, a fresh one every time, and of the data set in it.

    Returns
    -------
    PathSet
    """
    rng = np.random.default_rng([seed, number])
    path, light = str(rng.choice(list(PATHS))), str(rng.choice(LIGHT))
    kind = KINDS[int(rng.integers(len(KINDS)))]
    snr = float(np.exp(rng.uniform(np.log(30.0), np.log(3000.0))))
    return _data((path, light, "exact"), kind, int(rng.integers(8, 33)), snr, rng)


def _data(
    group: tuple[str, str, str],
    kind: Mapping[str, Any],
    frames: int,
    snr: float,
    rng: np.random.Generator,
) -> PathSet:
    path, light, told_of = group
    low = float(np.exp(rng.uniform(np.log(0.1), np.log(0.4))))
    high = low * float(np.exp(rng.uniform(np.log(2.0), np.log(6.0))))
    inside = np.exp(_BEYOND * np.log(high / low))
    ranges = PATHS[path](low * inside, high / inside, frames, rng)
    c0 = 0.08 * float(np.exp(0.7 * rng.standard_normal()))
    c1 = 2 * np.sqrt(c0) * float(np.expm1(0.4 * rng.standard_normal()))
    c2 = 0.1 * float(np.exp(0.5 * rng.standard_normal()))
    made: dict[str, Any] = {"object": {"c0": c0, "c1": c1, "c2": c2}}
    middle = float(object_flux(np.sqrt(low * high), c0 * c2, c0, c1))
    columns = ("w1", "w2") if kind["kind"] == "pulsed" else ("i", "q")
    truth = {"object.c0": c0, "object.c1": c1, "object.c2": c2}
    stated, error = TOLD[told_of]
    told: dict[str, Any] = dict(stated)
    made |= error
    if light in ("crosstalk", "both"):
        made["crosstalk"] = (0.1 * middle * rng.standard_normal(2)).tolist()
        told["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 0.3 * middle}] * 2
        for column, value in zip(columns, made["crosstalk"], strict=True):
            truth[f"crosstalk.{column}"] = value
    if light in ("background", "both"):
        strength, distance = float(middle * rng.uniform(0.3, 1.0)), float(rng.uniform(3.0, 6.0))
        shadow = shadow_of(c0, rng)
        made["background"] = {"strength": strength, "distance_m": distance, "shadow": shadow}
        prior = lognormal_about(strength, 0.5, rng)
        told["background"] = {"strength": prior, "distance_m": distance}
        truth["background.strength"] = strength
        truth |= {f"background.shadow.{name}": value for name, value in shadow.items()}
    noise = middle / snr
    sensor = parse_sensor({**kind, "noise": {"read": [noise, noise]}})
    trajectory = SampledTrajectory(range_m=ranges.tolist())
    seen = simulate(sensor, parse_scene(made), trajectory, rng).frames
    return PathSet(f"{path}, {light}", sensor, seen, told, ranges, truth)
