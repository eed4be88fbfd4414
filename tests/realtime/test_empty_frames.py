"""What frames without the object say against a scene, and doubts of units, in `assumptions`."""

import math
from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.frame.taken_for_crosstalk import TAKEN_FOR_CROSSTALK
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import Sensor, parse_sensor

READ = (2e-5, 1e-3)
KINDS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 2e7, "phase_offset_rad": 0.3},
}
EMPTY = 5
WALL: dict[str, Any] = {"strength": 0.5, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}}
PRIOR = {"prior": "halfnormal", "sd": 0.02}


def sensor_of(kind: str, **noise: float) -> Sensor:
    return parse_sensor({**KINDS[kind], "noise": {"read": list(READ), **noise}})


def said(sensor: Sensor, scene: dict[str, Any], bare: np.ndarray[Any, Any]) -> tuple[str, ...]:
    """Ask for the ranges of one frame with the object, after empty ones."""
    readings = np.vstack([bare, [[0.1, 0.4]]])
    present = np.array([False] * len(bare) + [True])
    return estimate(
        sensor, parse_scene(scene), Frames(readings, object_present=present)
    ).assumptions


def light_of_the_wall(kind: str) -> np.ndarray[Any, Any]:
    if kind == "pulsed":
        return np.array([0.5 * 3.0 / (299792458.0 * 1e-7 / 2), 0.5])
    phase = 4 * math.pi * 2e7 / 299792458.0 * 3.0 + 0.3
    return 0.5 * np.array([math.cos(phase), math.sin(phase)])


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
@pytest.mark.parametrize("scene", [{}, {"crosstalk": [0.004, 0.02]}, {"background": WALL}])
def test_empty_frames_that_contradict_the_scene(kind: str, scene: dict[str, Any]) -> None:
    """Their mean has a standard error of the noise over sqrt(5); a limit of 5 of these."""
    sensor = sensor_of(kind)
    honest = np.array(scene.get("crosstalk", [0.0, 0.0]))
    if "background" in scene:
        honest = honest + light_of_the_wall(kind)
    error = np.array(READ) / math.sqrt(EMPTY)
    for k, column in enumerate(sensor.columns):
        for away in (-5.1, -4.9, 4.9, 5.1):
            readings = np.tile(honest, (EMPTY, 1))
            readings[:, k] += away * error[k]
            found = said(sensor, scene, readings)
            assert len(found) == (abs(away) > 5), found
            if found:
                assert (
                    f"the 5 empty frames (object_present false) contradict the scene: on "
                    f"average they read {column} {readings[0, k]:.4g} where" in found[0]
                )
                assert "(5.1 off)" in found[0]
                assert ("where a wall stands" in found[0]) == ("background" not in scene)


def test_healthy_empty_frames_say_nothing() -> None:
    """Shot noise included; 400 means beyond 5 standard errors: false alarm 2.3e-4."""
    rng = np.random.default_rng(5)
    sensor = sensor_of("pulsed", shot=1e-6)
    stated = np.array([0.004, 0.02])
    sd = np.sqrt(np.square(READ) + 1e-6 * stated)
    for _ in range(200):
        bare = stated + sd * rng.standard_normal((EMPTY, 2))
        assert said(sensor, {"crosstalk": stated.tolist()}, bare) == ()


def test_what_a_scene_leaves_open_is_not_contradicted() -> None:
    bright = np.full((EMPTY, 2), 0.5)
    sensor = sensor_of("pulsed")
    wall = WALL | {"strength": {"prior": "lognormal", "median": 0.5, "sigma": 1.0}}
    assert said(sensor, {"background": wall}, bright) == ()
    assert said(sensor, {"crosstalk": [PRIOR, PRIOR], "background": WALL}, bright) == ()
    assert said(sensor, {"crosstalk": [PRIOR, 0.2]}, bright) == (TAKEN_FOR_CROSSTALK,)
    with_gain = Frames(
        np.vstack([2.0 * light_of_the_wall("pulsed"), [0.1, 0.4]]),
        object_present=np.array([False, True]),
        gain=np.array([2.0, 1.0]),
    )
    assert estimate(sensor, parse_scene({"background": WALL}), with_gain).assumptions == ()


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        ({"kind": "sine_wave", "frequency_hz": 20.0}, "frequency_hz 20 gives"),
        ({"kind": "sine_wave", "frequency_hz": 2e10}, "frequency_hz 2e+10 gives"),
        ({"kind": "pulsed", "pulse_width_s": 100.0}, "pulse_width_s 100 gives"),
        ({"kind": "pulsed", "pulse_width_s": 1e-10}, "pulse_width_s 1e-10 gives"),
        ({"kind": "sine_wave", "frequency_hz": 1e9}, None),
        ({"kind": "pulsed", "pulse_width_s": 1e-9}, None),
    ],
)
def test_units_that_cannot_be_meant_are_doubted(sensor: dict[str, Any], words: str | None) -> None:
    parsed = parse_sensor(sensor | {"noise": {"read": [1e-3, 1e-3]}})
    found = estimate(parsed, parse_scene({}), Frames(np.array([[0.1, 0.4]]))).assumptions
    assert len(found) == (words is not None)
    assert all(words is not None and text.startswith(words) for text in found)
