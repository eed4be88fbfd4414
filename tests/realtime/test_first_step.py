"""The one thing to do first where no technique has a result, and that doing it is enough."""

from typing import Any

import numpy as np
import pytest

from inference.estimate import estimate
from inference.estimates import LeftOut
from inference.first_step import first_step
from inference.plan import plan
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor

SENSORS: dict[str, dict[str, Any]] = {
    "pulsed": {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [2e-5, 1e-3]}},
    "sine_wave": {"kind": "sine_wave", "frequency_hz": 5e6, "noise": {"read": [1e-5, 1e-5]}},
}
LEAK = [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2
WALL = {"strength": {"prior": "lognormal", "median": 0.01, "sigma": 0.5}, "distance_m": 5.0}
PLATE = {"c0": 0.08, "c1": 0.05, "c2": 0.1}


def frames(objects: int, empty: int = 0, **more: Any) -> Frames:
    present = np.arange(objects + empty) < objects
    return Frames(np.full((objects + empty, 2), 0.01), object_present=present, **more)


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize(
    ("scene", "objects", "empty"),
    [
        ({"crosstalk": LEAK}, 1, 0),
        ({"crosstalk": LEAK}, 1, 5),
        ({"crosstalk": LEAK, "object": PLATE}, 1, 0),
        ({"background": WALL}, 1, 0),
        ({"background": WALL, "crosstalk": LEAK}, 3, 0),
        ({"background": {"strength": 0.01, "distance_m": 5.0}}, 2, 0),
    ],
)
def test_the_frames_that_are_asked_for_are_enough(
    kind: str, scene: dict[str, Any], objects: int, empty: int
) -> None:
    """As many as are said: a technique then serves, and with one fewer of the object none does."""
    sensor, parsed = parse_sensor(SENSORS[kind]), parse_scene(scene)
    found = estimate(sensor, parsed, frames(objects, empty))
    assert not found.results
    assert found.do_first is not None
    assert found.do_first.endswith("joint_fit then serves")
    words = found.do_first.split()
    empty = max(empty, 5 if "without the object" in found.do_first else 0)
    asked = words[words.index("of") - 2] if "different ranges" in found.do_first else objects
    assert plan(sensor, parsed, frames(int(asked), empty)).chosen == "joint_fit"
    if int(asked) > objects:
        assert plan(sensor, parsed, frames(int(asked) - 1, empty)).chosen is None


@pytest.mark.parametrize(
    ("scene", "more", "techniques", "words"),
    [
        ({}, {}, ["intensity"], "ask for conventional, or name no technique"),
        ({"crosstalk": LEAK, "motion": "static"}, {}, None, "take 5 frames without the object"),
        ({"crosstalk": LEAK, "motion": "tangential"}, {}, None, "give time_s, or derivative"),
        ({"crosstalk": {"values": LEAK, "optional": True}}, {}, None, "ask for a posterior"),
        ({"crosstalk": LEAK}, {"objects": 0, "empty": 3}, None, "show the object: all of these"),
    ],
)
def test_what_else_there_is_to_do(
    scene: dict[str, Any], more: dict[str, int], techniques: list[str] | None, words: str
) -> None:
    sensor, parsed = parse_sensor(SENSORS["pulsed"]), parse_scene(scene)
    of = frames(**({"objects": 1} | more))
    found = estimate(sensor, parsed, of, techniques)
    assert not found.results
    assert found.do_first is not None
    assert words in found.do_first
    if "time_s" in words:
        timed = Frames(np.full((3, 2), 0.01), time_s=np.arange(3.0))
        assert plan(sensor, parsed, timed).chosen == "differential"


def test_no_success_is_promised_of_a_fit_that_has_refused() -> None:
    """Crosstalk that drifts in a tank, say: with empty frames it refuses as before."""
    sensor, scene, of = (
        parse_sensor(SENSORS["pulsed"]),
        parse_scene({"crosstalk": LEAK}),
        frames(12),
    )
    refused = LeftOut("joint_fit", "the search stopped")
    found = first_step(sensor, scene, of, plan(sensor, scene, of), refused)
    assert found.startswith("take 5 frames without the object")
    assert found.endswith("ask joint_fit again: joint_fit says that the search stopped")


def test_a_sensor_that_is_not_calibrated_is_to_be_calibrated() -> None:
    unknown = {"prior": "normal", "mean": 0.0, "sd": 0.1}
    sensor = parse_sensor(SENSORS["sine_wave"] | {"phase_offset_rad": unknown})
    found = estimate(sensor, parse_scene({}), frames(3))
    assert found.do_first is not None
    assert "known_range_m" in found.do_first


DRIFT = {"gain_drift_per_k": {"prior": "normal", "mean": 0.0, "sd": 3e-3}}
LATE = {"prior": "normal", "mean": 0.0, "sd": 3e-10}


@pytest.mark.parametrize(
    ("more", "unknown"),
    [
        ({"temperature": DRIFT}, "sensor.temperature.gain_drift_per_k"),
        ({"timing_offset_s": LATE}, "sensor.timing_offset_s"),
    ],
)
@pytest.mark.parametrize("techniques", [None, ["joint_fit"]])
def test_a_calibrated_sensor_that_no_fit_takes_is_one_for_a_posterior(
    more: dict[str, Any], unknown: str, techniques: list[str] | None
) -> None:
    """Before other objects than the one of the calibration: nothing of it is a number."""
    sensor = parse_sensor(SENSORS["pulsed"] | more)
    law = {"unknowns": [unknown], "modes": [{"mean": [0.1], "covariance": [[0.01]]}]}
    scene = parse_scene({"background": {"strength": 0.01, "distance_m": 5.0}, "joint": law})
    of = frames(15, temperature_k=np.full(15, 300.0))
    choice = plan(sensor, scene, of)
    assert choice.chosen is None
    found = estimate(sensor, scene, of, techniques)
    assert not found.results
    assert found.do_first is not None
    assert found.do_first.startswith("ask for a posterior (hybridtof infer")
    for left_out in (choice.left_out, found.left_out):
        reasons = {item.name: item.reason for item in left_out}
        assert "a posterior of these frames" in reasons["joint_fit"]


def test_where_bounds_alone_are_told_a_fit_is_named_or_what_it_takes() -> None:
    leak = [{"prior": "normal", "mean": 0.0, "sd": 0.2}] * 2  # as wide as the light
    sensor, scene = parse_sensor(SENSORS["pulsed"]), parse_scene({"crosstalk": leak})
    ranges = np.linspace(0.3, 1.0, 8)
    light = 0.1 * 0.08 / (ranges**2 * (ranges**2 + 0.08))
    readings = np.stack([light * ranges / 15.0, light], axis=1)
    many = Frames(readings, time_s=np.arange(8.0))
    found = estimate(sensor, scene, many)
    assert found.chosen == "differential"
    assert found.do_first is not None
    assert found.do_first.endswith("ask for joint_fit, which tells ranges of these frames")
    few = estimate(sensor, scene, Frames(readings[:3], time_s=np.arange(3.0))).do_first
    assert few is not None
    assert "take 5 frames without the object (object_present false) and 4 frames of the" in few
    known = estimate(sensor, parse_scene({"crosstalk": leak, "object": PLATE}), many)
    assert (known.chosen, known.do_first) == ("differential", None)


def test_where_there_is_a_result_there_is_nothing_to_do() -> None:
    sensor = parse_sensor(SENSORS["pulsed"])
    assert estimate(sensor, parse_scene({}), frames(1)).do_first is None
