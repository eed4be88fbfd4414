"""What frames without the object say against a scene, and doubts of units, in `assumptions`."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from inference.contradicted import CONTRADICTED, without_moved
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
    scene = scene | {"discrepancy": 0}
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
    bare = np.tile(1.7 * light_of_the_wall("pulsed"), (EMPTY, 1))
    assert said(sensor, {"background": wall}, bare) == ()
    assert said(sensor, {"crosstalk": [PRIOR, PRIOR], "background": WALL}, bright) == ()
    assert said(sensor, {"crosstalk": [PRIOR, 0.2]}, bright) == (TAKEN_FOR_CROSSTALK,)
    with_gain = Frames(
        np.vstack([2.0 * light_of_the_wall("pulsed"), [0.1, 0.4]]),
        object_present=np.array([False, True]),
        gain=np.array([2.0, 1.0]),
    )
    assert estimate(sensor, parse_scene({"background": WALL}), with_gain).assumptions == ()


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_the_direction_of_a_wall_of_unknown_strength(kind: str) -> None:
    """The error of the effective distance is granted; then 200 means: false alarm 1.2e-4."""
    rng = np.random.default_rng(6)
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [2e-5, 2e-5]}})
    wall = WALL | {"strength": {"prior": "lognormal", "median": 0.5, "sigma": 1.0}}
    light = light_of_the_wall(kind)
    for scale in (0.1, 1.0):
        for _ in range(100):
            bare = scale * light + 2e-5 * rng.standard_normal((EMPTY, 2))
            assert said(sensor, {"background": wall}, bare) == ()
    for metres, told in ((3.003, 0), (3.2, 1)):
        wrong = said(sensor, {"background": wall | {"distance_m": metres}}, bare)
        assert len(wrong) == told, wrong
    assert "no strength of a wall at the stated distance" in wrong[0]
    exact = {"background": wall | {"distance_m": 3.003}, "discrepancy": 0}
    assert len(said(sensor, exact, bare)) == 1


def test_shot_noise_of_both_windows_is_of_the_same_photons() -> None:
    """Across the light of the wall: its strength follows the readings along that alone."""
    sensor = sensor_of("pulsed", shot=1e-5)
    wall = WALL | {"strength": {"prior": "lognormal", "median": 0.5, "sigma": 1.0}}
    light = light_of_the_wall("pulsed")
    across = np.array([-light[1], light[0]]) / np.linalg.norm(light)
    late, whole = np.square(READ) + 1e-5 * light
    covariance = np.array([[late, 1e-5 * light[0]], [1e-5 * light[0], whole]])
    error = math.sqrt(across @ covariance @ across / EMPTY)
    for away in (-5.1, -4.9, 4.9, 5.1):
        bare = np.tile(light + away * error * across, (EMPTY, 1))
        found = said(sensor, {"background": wall, "discrepancy": 0}, bare)
        assert len(found) == (abs(away) > 5), found


def test_the_error_of_the_distance_is_granted_of_the_light_that_was_read() -> None:
    """With a gain of 2 the wall reads twice as much, and an error of its distance does."""
    sensor, granted, gain = sensor_of("pulsed"), 0.01, 2.0
    light = gain * light_of_the_wall("pulsed")
    of_distance = granted * light[0] / WALL["distance_m"]
    error = math.hypot(of_distance, READ[0] / math.sqrt(EMPTY))
    scene = {"background": WALL, "discrepancy": {"flux": 0.01, "range_m": granted}}
    for away in (-5.1, -4.9, 4.9, 5.1):
        bare = np.tile(light + np.array([away * error, 0.0]), (EMPTY, 1))
        frames = Frames(
            np.vstack([bare, [[0.1, 0.4]]]),
            object_present=np.array([False] * EMPTY + [True]),
            gain=np.array([gain] * EMPTY + [1.0]),
        )
        assert len(estimate(sensor, parse_scene(scene), frames).assumptions) == (abs(away) > 5)


def test_what_a_joint_law_leaves_open_is_no_contradiction() -> None:
    """0.0035 off, and five of noise and law together are 0.0037 and 0.0030."""
    sensor = sensor_of("pulsed")
    for sd, told in ((6e-4, 0), (4e-4, 1)):
        prior = {"prior": "normal", "mean": 0.02, "sd": sd}
        mode = {"weight": 1.0, "mean": [0.0], "covariance": [[1.0]]}
        joint = {"unknowns": ["crosstalk.w2"], "modes": [mode]}
        scene = {"crosstalk": [0.004, prior], "joint": joint}
        found = said(sensor, scene, np.array([[0.004, 0.0235]] * EMPTY))
        assert len([text for text in found if "contradict" in text]) == told, found


@pytest.mark.parametrize("kind", ["pulsed", "sine_wave"])
def test_ranges_that_contradicted_numbers_move_are_not_given(kind: str) -> None:
    """A reference beside it: the same frames with what empty frames read as the crosstalk."""
    sensor = parse_sensor({**KINDS[kind], "noise": {"read": [1e-4, 1e-4]}})
    r = np.array([0.2, 0.5, 1.0, 1.5])
    flux = np.array([1000.0, 0.2, 0.1, 0.05])
    phase = 4 * math.pi * 2e7 / 299792458.0 * r + 0.3
    shape = [r / 14.9896229, np.ones(4)] if kind == "pulsed" else [np.cos(phase), np.sin(phase)]
    light = flux[:, None] * np.stack(shape, axis=1)
    shown = np.array([0.01, 0.02])
    readings = np.vstack([np.tile(shown, (EMPTY, 1)), light + shown])
    frames = Frames(readings, object_present=np.arange(EMPTY + 4) >= EMPTY)
    honest = estimate(sensor, parse_scene({"crosstalk": shown.tolist()}), frames).results[0]
    answer = estimate(sensor, parse_scene({"crosstalk": [0.009, 0.018]}), frames)
    result = answer.results[0]
    wrong = estimate(
        sensor,
        parse_scene({"crosstalk": [0.009, 0.018]}),
        frames.select(np.arange(EMPTY, EMPTY + 4)),
    ).results[0]
    moved = np.abs(wrong.range_m - honest.range_m[EMPTY:]) > wrong.sd_m
    assert not moved[0]
    assert moved[[1, 3]].all()
    assert np.array_equal(np.isnan(result.range_m[EMPTY:]), moved)
    assert {result.reasons[i] for i in result.reason[EMPTY:][moved]} == {CONTRADICTED}
    assert len(answer.assumptions) == 1
    assert np.isnan(result.roots_sd_m[EMPTY:][moved]).all()
    fitted = estimate(sensor, parse_scene({"crosstalk": [0.009, 0.018]}), frames, ["object_fit"])
    for found in fitted.results:
        assert found.parameters is not None
        assert {entry["status"] for entry in found.parameters.values()} == {"not_identified"}
    # what does not rest on the numbers stands
    free = parse_scene({"crosstalk": [0.009, 0.018], "object": {"c0": 0.08, "c1": 0.05}})
    timed = dataclasses.replace(frames, time_s=0.1 * np.arange(EMPTY + 4, dtype=np.float64))
    left = estimate(sensor, free, timed, ["differential"]).results[0]
    assert CONTRADICTED not in {left.reasons[i] for i in left.reason}


def test_a_range_may_move_by_its_standard_deviation_and_no_root_may_come_or_go() -> None:
    sensor = parse_sensor({**KINDS["pulsed"], "noise": {"read": [1e-4, 1e-4]}})
    frames = Frames(np.array([[0.01, 0.4], [0.02, 0.3], [0.03, 0.2], [0.04, 0.1]]))
    result = estimate(sensor, parse_scene({}), frames).results[0]
    assert result.root_count.tolist() == [1] * 4
    result = dataclasses.replace(result, near_fold=np.ones(4, dtype=bool))
    by = np.array([0.9, -0.9, 1.1, -1.1])[:, None] * result.roots_sd_m
    found = without_moved(result, dataclasses.replace(result, roots_m=result.roots_m + by))
    kept = np.array([True, True, False, False])
    assert np.array_equal(np.isfinite(found.range_m), kept)
    assert np.array_equal(found.near_fold, kept)
    more = np.array([1, 2, 1, 2])
    second = np.where(more[:, None] == 2, 2.0 * result.roots_m[:, :1], np.nan)
    other = dataclasses.replace(
        result, roots_m=np.column_stack([result.roots_m, second]), root_count=more
    )
    assert np.array_equal(np.isfinite(without_moved(result, other).range_m), more == 1)


@pytest.mark.parametrize(
    ("sensor", "words"),
    [
        ({"kind": "sine_wave", "frequency_hz": 20.0}, "frequency_hz 20 gives"),
        ({"kind": "sine_wave", "frequency_hz": 2e10}, "frequency_hz 2e+10 gives"),
        ({"kind": "pulsed", "pulse_width_s": 100.0}, "pulse_width_s 100 gives"),
        ({"kind": "pulsed", "pulse_width_s": 1e-10}, "pulse_width_s 1e-10 gives"),
        ({"kind": "sine_wave", "frequency_hz": 1e9}, None),
        ({"kind": "pulsed", "pulse_width_s": 1e-9}, None),
        (
            {"kind": "sine_wave", "frequency_hz": 2e7, "phase_offset_rad": 25.0},
            "phase_offset_rad 25 is",
        ),
        ({"kind": "sine_wave", "frequency_hz": 2e7, "phase_offset_rad": -6.283185}, None),
    ],
)
def test_units_that_cannot_be_meant_are_doubted(sensor: dict[str, Any], words: str | None) -> None:
    parsed = parse_sensor(sensor | {"noise": {"read": [1e-3, 1e-3]}})
    found = estimate(parsed, parse_scene({}), Frames(np.array([[0.1, 0.4]]))).assumptions
    assert len(found) == (words is not None)
    assert all(words is not None and text.startswith(words) for text in found)


@pytest.mark.parametrize(
    ("ranges", "doubted"),
    [((100.0, 2000.0), True), ((0.1, 74.0), False), ((0.1, 76.0), True), ((0.1, 7600.0), False)],
)
def test_ranges_of_many_turns_may_be_in_millimetres(
    ranges: tuple[float, float], doubted: bool
) -> None:
    """A turn of 20 MHz is 7.49 m; more than a thousand of them are no millimetres of one."""
    noise = {"read": [1e-3, 1e-3]}
    parsed = parse_sensor({"kind": "sine_wave", "frequency_hz": 2e7, "noise": noise})
    low, high = ranges
    scene = parse_scene({"range_m": {"prior": "reference", "low": low, "high": high}})
    found = estimate(parsed, scene, Frames(np.array([[0.1, 0.4]]))).assumptions
    assert found == (
        (f"range_m goes on to {high:.4g}, and phases begin anew each 7.49 m: is it in metres?",)
        if doubted
        else ()
    )


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"temperature_k": [25.0, 298.15]}, "temperature_k is 25 in frame 0: is it in kelvin"),
        ({"temperature_k": [200.0, 500.0]}, None),
        ({"time_s": [0.1, 0.1]}, "time_s does not increase"),
        ({"time_s": [0.1, 0.2]}, None),
    ],
)
def test_columns_that_cannot_be_meant_are_doubted(
    columns: dict[str, list[float]], words: str | None
) -> None:
    sensor = {**KINDS["pulsed"], "noise": {"read": list(READ)}}
    parsed = parse_sensor(sensor | {"temperature": {"gain_drift_per_k": 0.0}})
    frames = Frames(
        np.array([[0.1, 0.4]] * 2), **{name: np.array(cells) for name, cells in columns.items()}
    )
    found = estimate(parsed, parse_scene({}), frames).assumptions
    assert [text for text in found if words and text.startswith(words)] == list(found)
    assert bool(found) == (words is not None)
