"""Between which ranges a message says that a technique answers, and where its answers are."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.known import known_of
from inference.realtime.registry import TECHNIQUES
from service.messages.measured import limits_of
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

_NOISE = {"read": [1e-12, 1e-12], "derivative": [1e-12, 1e-12]}
PULSE = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": _NOISE}
WAVE = {"kind": "sine_wave", "frequency_hz": 2e7, "noise": _NOISE}
OBJECT = {"object": {"c0": 0.0769, "c1": 0.0, "c2": 0.0957}, "discrepancy": 0}
WALL = {
    "background": {
        "strength": 1e-4, "distance_m": 6.0, "shadow": {"c0": 0.056, "c1": 0.013},
    }
}  # fmt: skip
FAR = {"range_m": {"prior": "reference", "low": 1e-3, "high": 20.0}}


@pytest.mark.parametrize(
    ("name", "sensor", "scene"),
    [
        ("conventional", WAVE, {}),
        ("differential", PULSE, {}),
        ("differential", WAVE, {}),
        ("differential", WAVE, {"motion": "tangential"}),
        ("background_cancelling_differential", WAVE, WALL),
    ],
)
def test_answers_come_near_the_limit_and_not_beyond(
    name: str, sensor: dict[str, Any], scene: dict[str, Any]
) -> None:
    """Readings of all directions: of a sine wave derivatives end at c/4f, half of its range."""
    known = parse_scene(OBJECT | scene | ({} if "background" in scene else FAR))
    parsed = parse_sensor(sensor)
    angle = np.linspace(0.0, np.pi if sensor is PULSE else 2 * np.pi, 400)
    ways = np.column_stack([np.cos(angle), np.sin(angle)])
    frames = Frames(ways, derivatives=ways if TECHNIQUES[name].differential else None)
    (found,) = estimate(parsed, known, frames, [name]).results
    _, high = limits_of(TECHNIQUES[name], parsed, known_of(known))
    farthest = np.nanmax(found.roots_m)
    assert 0.9 * high < farthest <= high
