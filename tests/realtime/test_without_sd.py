"""A unique range without a standard deviation says why, whatever the scene."""

import json
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import Status
from inference.realtime.registry import TECHNIQUES
from service.answers.encoding import encode_estimates
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

NOISE = {"read": [1e-4, 1e-4]}
PULSED = parse_sensor({"kind": "pulsed", "pulse_width_s": 3e-8, "noise": NOISE})
SINE = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": NOISE})


def scene_of(sensor: Sensor, rng: np.random.Generator) -> dict[str, Any]:
    """A random object, by turns before a wall and with crosstalk by a joint law."""
    c0 = float(np.exp(rng.uniform(-4, -1)))
    shape = {"c0": c0, "c1": float(rng.uniform(-1, 1) * np.sqrt(c0)), "c2": 0.1}
    scene: dict[str, Any] = {"object": shape}
    if rng.random() < 0.5:
        shadow = {"c0": c0, "c1": shape["c1"]}
        distance = float(rng.uniform(1.5, 4.0))
        scene["background"] = {"strength": 0.01, "distance_m": distance, "shadow": shadow}
    if rng.random() < 0.7:
        scene["crosstalk"] = [{"prior": "normal", "mean": 0.0, "sd": 0.01}] * 2
        mode = {"mean": [0.0, 0.0], "covariance": [[1.0, 0.3], [0.3, 1.0]]}
        names = [f"crosstalk.{column}" for column in sensor.columns]
        scene["joint"] = {"unknowns": names, "modes": [mode]}
    return scene


@pytest.mark.parametrize("sensor", [PULSED, SINE], ids=["pulsed", "sine_wave"])
def test_every_range_without_an_error_says_why(sensor: Sensor) -> None:
    rng, seen, beside = np.random.default_rng(7), 0, 0
    for _ in range(30):
        scene = parse_scene(scene_of(sensor, rng))
        size = np.exp(rng.uniform(np.log(1e-5), np.log(0.3), (60, 1)))
        frames = Frames(size * rng.uniform(-0.3, 1.0, (60, 2)))
        found = estimate(sensor, scene, frames, list(TECHNIQUES))
        for result in found.results:
            bare = (result.status == Status.UNIQUE) & np.isnan(result.sd_m)
            seen += int(bare.sum())
            beside += int((bare & result.near_fold).sum())
            assert all(result.reasons[code] for code in result.reason[bare]), result.technique
        for told in json.loads(encode_estimates(found))["results"]:
            for frame in told["frames"]:
                if frame["range_m"] is not None and frame["sd_m"] is None:
                    assert frame["reason"]
    assert seen > 100
    assert beside > 50
