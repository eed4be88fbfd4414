"""Sensors, scenes and frames of the golden requests."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings, simulate
from simulator.trajectories import SampledTrajectory

__all__ = [
    "BARE",
    "BOTH_KINDS",
    "CROSSTALK",
    "OBJECT",
    "REFERENCE",
    "STROKE",
    "UNKNOWN_CROSSTALK",
    "UNKNOWN_WALL",
    "WALL",
    "Data",
    "frames_of",
    "moving",
    "sensor_of",
    "with_derivatives",
]

Array = NDArray[np.float64]
Data = dict[str, Any]

OBJECT: Data = {"c0": 0.0769, "c1": -0.123, "c2": 0.0957}  # a diffuse plate of 0.4 m
BARE: Data = {"object": OBJECT}
CROSSTALK = [0.002, 0.01]
UNKNOWN_CROSSTALK: list[Data] = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2
WALL: Data = {"strength": 0.0177, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
UNKNOWN_WALL: Data = {
    "strength": {"prior": "lognormal", "median": 0.02, "sigma": 1.0},
    "distance_m": {"prior": "uniform", "low": 2.2, "high": 8.0},
}
STROKE: Data = {"prior": "stroke", "low": 0.1, "high": 3.0}
REFERENCE: Data = {"prior": "reference", "low": 0.1, "high": 3.0}
BOTH_KINDS = ("pulsed", "sine_wave")
_TIMING: dict[str, Data] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6, "phase_offset_rad": 0.3},
}


def sensor_of(kind: str, read: float = 7.72e-6, **more: Any) -> Sensor:
    """Return a sensor; ``noise`` in ``more`` adds to the read noise."""
    noise = {"read": [read, 1.25 * read], **more.pop("noise", {})}
    return parse_sensor({**_TIMING[kind], "noise": noise, **more})


def moving(count: int, low: float = 0.2, high: float = 1.6) -> list[float]:
    """Return ranges from near to far."""
    return [float(r) for r in np.geomspace(low, high, count)]


def frames_of(
    sensor: Sensor,
    truth: Data,
    ranges: list[float],
    empty: int = 0,
    seed: int = 1,
    amplitude: list[float] | None = None,
) -> Frames:
    """Simulate frames of a scene in which all is known, empty ones last, 0.02 s apart."""
    n = len(ranges) + empty
    path = SampledTrajectory(
        time_s=(0.02 * np.arange(n)).tolist(),
        range_m=ranges + [ranges[-1]] * empty,
        object_present=[True] * len(ranges) + [False] * empty,
        amplitude=amplitude,
    )
    return simulate(sensor, parse_scene(truth), path, seed).frames


def with_derivatives(
    sensor: Sensor, truth: Data, frames: Frames, ranges: list[float], seed: int = 11
) -> Frames:
    """Add derivative columns of an object that moves away by 1 m/s."""
    terms = parameters_of(sensor, parse_scene(truth)).terms(np.empty((1, 0)))
    at, h = np.array(ranges), 1e-6
    ends = [mean_readings(sensor, terms, at * (1 + sign * h)) for sign in (1, -1)]
    slopes = (ends[0] - ends[1]) / (2 * h * at[:, None])
    noise = np.asarray(sensor.noise.derivative or (0.0, 0.0))
    drawn = np.random.default_rng(seed).standard_normal(slopes.shape)
    return dataclasses.replace(frames, derivatives=slopes + noise * drawn)
