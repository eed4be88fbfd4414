"""The benchmark of streams that calibrate themselves, half a minute long, on its own arithmetic."""

from pathlib import Path

import numpy as np

from benchmarks.missed_stretches import drawn
from benchmarks.self_calibration import (
    HZ,
    OBJECT,
    SETTINGS,
    STATED,
    course,
    draw,
    figures,
    followed,
    longest_s,
    sensor_of,
    where_longest,
    wrong_of,
)
from inference.self_calibration.calibration import Asked, Outcome
from inference.self_calibration.plan import plan_of
from inference.self_calibration.scenes import trackable
from simulator.scene import parse_scene
from simulator.sensor import Sensor


def test_the_longest_stretch() -> None:
    wrong = np.zeros(100, dtype=bool)
    assert longest_s(wrong) == 0.0
    wrong[[3, 10, 11, 12, 99]] = True
    assert longest_s(wrong) == 3 / HZ
    off = np.arange(100.0)
    assert where_longest(wrong, off) == (10 / HZ, 12.0)
    assert where_longest(~wrong, off) == (13 / HZ, 98.0)
    assert where_longest(np.zeros(3, dtype=bool), off) == (0.0, 0.0)


def test_a_short_course_is_followed_counted_and_drawn(tmp_path: Path) -> None:
    asked: list[int] = []

    def refused(_: Sensor, of: Asked) -> Outcome:
        asked.append(of.number)
        return Outcome(None, "nothing is computed here")

    of = course(40.0, 0, cold=False)
    there = np.isfinite(of.range_m)
    assert 0.8 < there.mean() < 0.9
    assert not there[: 2 * HZ].any()
    said = followed(of, 0, compute=refused)
    found = figures(of, said)
    assert asked == list(range(1, len(asked) + 1))
    assert (found["asked"], found["taken"], found["given up"]) == (len(asked), 0, 0)
    assert [event["kind"] for event in said.events] == ["not_taken"]
    # what priors alone say is wide: never sure and wrong for a second
    assert wrong_of(of, said).shape == there.shape
    assert found["wrong s"] < 1.0
    assert found["width"] > 0.1
    draw(tmp_path / "picture.png", [("warm", of, said)])
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_truths_are_drawn_from_what_is_believed() -> None:
    """A law a hundred times wider misses nothing less: its own draws are as far apart."""
    plan = plan_of(sensor_of(), parse_scene(STATED), SETTINGS, 0)
    ranges = np.full(115, 0.6)
    for sigma in (1e-3, 0.1):
        c2 = {"prior": "lognormal", "median": OBJECT["c2"], "sigma": sigma}
        law = trackable(plan.sensor, parse_scene({"object": OBJECT | {"c2": c2}}))
        for erring in (False, True):
            found = drawn(plan, law, ranges, 2, 1, erring)
            again = drawn(plan, law, ranges, 2, 1, erring)
            np.testing.assert_array_equal(found.longest, again.longest)
            assert found[1:] == again[1:]
            # 25 frames are too few for a second; 5 standard deviations in one of 8 draws: 5e-6
            assert found.longest.max() < 1.0
            assert found.off < 5.0
