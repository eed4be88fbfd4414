"""What is answered before the last technique has: all of it, and nothing that is not so."""

import itertools
from typing import Any

import numpy as np
import pytest

from inference import run
from inference.estimate import estimate
from inference.estimates import Estimates
from inference.in_turn import estimates_in_turn
from inference.plan import plan
from inference.techniques import ALL_TECHNIQUES
from simulator.frames import Frames
from simulator.scene import Scene, parse_scene
from simulator.sensor import Sensor, parse_sensor

SENSOR = parse_sensor({"kind": "pulsed", "pulse_width_s": 1e-7, "noise": {"read": [1e-6, 1e-6]}})
RANGES_M = np.array([0.3, 0.5, 0.7, 0.9])
READINGS = np.stack([0.3 / RANGES_M**2 * RANGES_M / SENSOR.max_range_m, 0.3 / RANGES_M**2], axis=1)
FRAMES = Frames(READINGS, time_s=np.array([0.0, 0.1, 0.2, 0.3]))
SCENE = parse_scene({"object": {"c0": 0.0769, "c1": -0.123}})
WAITING = "has not answered yet"
NAMES = ("joint_fit", "differential", "intensity", "posterior", "conventional")
LIGHT: list[dict[str, Any]] = [
    {"prior": "normal", "mean": mean, "sd": 0.02 * mean} for mean in (0.002, 0.01)
]


def turns_of(
    scene: Scene, frames: Frames, names: tuple[str, ...] | None
) -> tuple[list[Estimates], Estimates]:
    turns = estimates_in_turn(SENSOR, scene, frames, plan(SENSOR, scene, frames), names, WAITING)
    told = []
    while True:
        try:
            told.append(next(turns))
        except StopIteration as end:
            return told, end.value


def assert_same(one: Estimates, other: Estimates) -> None:
    """But for the time that it took."""
    assert [each.technique for each in one.results] == [each.technique for each in other.results]
    for a, b in zip(one.results, other.results, strict=True):
        np.testing.assert_array_equal(a.roots_m, b.roots_m)
        np.testing.assert_array_equal(a.roots_sd_m, b.roots_sd_m)
    assert (one.chosen, one.left_out, one.assumptions, one.do_first) == (
        other.chosen,
        other.left_out,
        other.assumptions,
        other.do_first,
    )


@pytest.mark.parametrize("names", list(itertools.permutations(NAMES, 3))[::5])
def test_what_is_answered_by_then_is_as_it_will_be(names: tuple[str, ...]) -> None:
    told, last = turns_of(SCENE, FRAMES, names)
    assert_same(last, estimate(SENSOR, SCENE, FRAMES, names))
    final = {each.technique: each for each in last.results}
    able = sorted(final, key=lambda name: ALL_TECHNIQUES[name].cost)
    assert len(told) == max(len(able) - 1, 0)
    for number, so_far in enumerate(told, 1):
        # the cheapest first, in the order asked for, and each other one has its reason
        assert [each.technique for each in so_far.results] == [
            name for name in names if name in able[:number]
        ]
        for result in so_far.results:
            np.testing.assert_array_equal(result.roots_m, final[result.technique].roots_m)
        reasons = {item.name: item.reason for item in so_far.left_out}
        known = {item.name: item.reason for item in last.left_out}
        assert reasons == known | dict.fromkeys(able[number:], WAITING)
        assert so_far.chosen in able[:number]
        assert so_far.do_first is None


def test_nothing_is_told_where_nothing_has_answered() -> None:
    told, last = turns_of(SCENE, FRAMES, ("intensity", "joint_fit"))
    assert not told
    assert last.chosen == "joint_fit"


def test_a_prior_of_the_crosstalk_answers_before_a_fit_is_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = parse_scene({"object": {"c0": 0.0769, "c1": -0.123, "c2": 0.1}, "crosstalk": LIGHT})
    untimed = Frames(np.add(READINGS, [0.002, 0.01]))
    assert plan(SENSOR, scene, untimed).chosen == "joint_fit"
    asked, solved = [], run._solved

    def noted(sensor: Sensor, of: Scene, frames: Frames, name: str) -> Any:
        asked.append(name)
        return solved(sensor, of, frames, name)

    monkeypatch.setattr(run, "_solved", noted)
    turns = estimates_in_turn(SENSOR, scene, untimed, plan(SENSOR, scene, untimed), None, WAITING)
    so_far = next(turns)
    assert "joint_fit" not in asked
    (result,) = so_far.results
    assert result.technique == so_far.chosen
    reasons = {item.name: item.reason for item in so_far.left_out}
    assert reasons["joint_fit"] == WAITING
    told, last = turns_of(scene, untimed, None)
    assert len(told) == 1
    assert_same(last, estimate(SENSOR, scene, untimed))
