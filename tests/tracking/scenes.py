"""Scenes and paths that the tests of the tracker share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from simulator.frames import Frames
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor
from simulator.simulate import mean_readings
from tests.posterior.scenes import KINDS, OBJECT

Array = NDArray[np.float64]

STEP = 0.02  # seconds between frames
# w2 falls to the fold at 0.986 m and rises beyond it, as the object hides less of the background
FOLD_M = 0.98552768
FOLDED: dict[str, Any] = {
    "object": {"c0": 0.0769, "c1": -0.123, "c2": 0.03},
    "background": {"strength": 0.1, "distance_m": 10.0, "shadow": {"c0": 0.056, "c1": 0.01}},
    "range_m": {"prior": "loguniform", "low": 0.2, "high": 2.9},
}
PLATE: dict[str, Any] = {
    "object": OBJECT,
    "range_m": {"prior": "loguniform", "low": 0.1, "high": 3.0},
}


def sensor_of(read: float, kind: str = "pulsed", **more: Any) -> Sensor:
    """A sensor with equal read noise in both readings."""
    noise = {"read": [read, read], **more.pop("noise", {})}
    return parse_sensor({**KINDS[kind], "noise": noise, **more})


def scene_of(data: dict[str, Any], **more: Any) -> Scene:
    """A scene whose model is exact unless something else is said."""
    return parse_scene({"discrepancy": 0, **data, **more})


def wander(
    rng: np.random.Generator,
    count: int,
    settings: TrackingSettings,
    start: tuple[float, float],
    seconds: float = STEP,
) -> tuple[Array, Array]:
    """Draw log r and its rate from the motion that the settings state, by many small steps."""
    s, tau, parts = settings.rate_sd, settings.rate_time_s, 100
    h = seconds / parts
    u, v = start
    way, rates = [u], [v]
    decay = np.exp(-h / tau)
    for _ in range(count - 1):
        for kick in rng.standard_normal(parts) * s * np.sqrt(-np.expm1(-2 * h / tau)):
            new = decay * v + kick
            u += 0.5 * h * (v + new)
            v = new
        way.append(u)
        rates.append(v)
    return np.array(way), np.array(rates)


def read(sensor: Sensor, scene: Scene, ranges: Array, rng: np.random.Generator) -> Array:
    """Noisy readings (read noise only); inf where no object is there."""
    terms = parameters_of(sensor, scene).terms(np.zeros((1, 0)))
    means = mean_readings(sensor, terms, ranges)
    return means + np.asarray(sensor.noise.read) * rng.standard_normal(means.shape)


def frames_of(readings: Array, seconds: float = STEP) -> Frames:
    return Frames(readings, time_s=seconds * np.arange(len(readings), dtype=np.float64))
