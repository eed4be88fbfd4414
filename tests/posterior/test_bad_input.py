"""Bad input of the posterior: refused before any sampling, or answered with what is wrong said."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from inference.posterior import checks, fold
from inference.posterior.answer.posterior import Posterior
from inference.posterior.infer import infer
from inference.posterior.settings import SamplerSettings
from inference.posterior.stages.stage import Starting
from inference.posterior.stages.starting import begin
from simulator.errors import InvalidInputError, RefusedError
from simulator.frames import Frames
from simulator.scene import parse_scene
from simulator.sensor import parse_sensor
from tests.posterior.scenes import OBJECT, UNKNOWN_CROSSTALK, data, sensor_of

QUICK = SamplerSettings(seed=7, target_ess=50, max_seconds=30)
SENSOR = sensor_of("pulsed")
FRAMES = data(SENSOR).frames


def with_reading(value: float) -> Frames:
    readings = FRAMES.readings.copy()
    readings[3, 0] = value
    return Frames(readings)


def told(range_m: float | None, sd_m: float | None) -> Frames:
    """Frames of which the range of the fourth alone is known."""

    def column(value: float | None, rest: float) -> np.ndarray | None:
        return None if value is None else np.where(np.arange(20) == 3, value, rest)

    known, sd = column(range_m, np.nan), column(sd_m, 0.01)
    return dataclasses.replace(FRAMES, known_range_m=known, known_range_sd_m=sd)


def moved(displacement_m: np.ndarray, sd_m: float | None) -> Frames:
    sd = None if sd_m is None else np.full(20, sd_m)
    return dataclasses.replace(FRAMES, displacement_m=displacement_m, displacement_sd_m=sd)


@pytest.mark.parametrize(
    ("frames", "pointer"),
    [
        (Frames(np.empty((0, 2))), "/frames/w1"),
        (Frames(np.empty(0)), "/frames"),
        (Frames(np.ones((4, 3))), "/frames"),
        (with_reading(np.nan), "/frames/w1"),
        (with_reading(-np.inf), "/frames/w1"),
        (dataclasses.replace(FRAMES, gain=np.zeros(20)), "/frames/gain"),
        (dataclasses.replace(FRAMES, gain=np.full(20, np.nan)), "/frames/gain"),
        (dataclasses.replace(FRAMES, gain=np.ones(19)), "/frames/gain"),
        (
            dataclasses.replace(FRAMES, object_present=np.ones(3, dtype=bool)),
            "/frames/object_present",
        ),
        (moved(np.full(20, 1.0), None), "/frames/displacement_sd_m"),
        (moved(np.full(20, 1.0), 0.0), "/frames/displacement_sd_m"),
        (moved(np.linspace(0.0, 15.0, 20), 0.01), "/frames/displacement_m"),  # r0 is 14.99 m
        (moved(np.linspace(0.0, 14.98, 20), 0.01), "/frames/displacement_m"),  # from 0.02 m on
        (
            dataclasses.replace(
                moved(np.linspace(0.0, 1.0, 20), 0.01),
                known_range_m=np.linspace(0.5, 1.4, 20),
                known_range_sd_m=np.full(20, 0.001),
            ),
            "/frames/displacement_m",
        ),
        (told(None, 0.01), "/frames/known_range_m"),
        (told(1.0, None), "/frames/known_range_sd_m"),
        (told(1.0, 0.0), "/frames/known_range_sd_m"),
        (told(1.0, -1.0), "/frames/known_range_sd_m"),
        (told(1.0, np.nan), "/frames/known_range_sd_m"),
        (told(0.0, 0.01), "/frames/known_range_m"),
        (told(np.inf, 0.01), "/frames/known_range_m"),
        (told(15.0, 0.01), "/frames/known_range_m"),  # r0 is 14.99 m
        (told(0.01, 1e-3), "/frames/known_range_m"),  # range_m begins at 0.02 m
        (
            dataclasses.replace(told(1.0, 0.1), known_range_sd_m=np.ones(3)),
            "/frames/known_range_sd_m",
        ),
        (
            dataclasses.replace(told(1.0, 0.1), object_present=np.zeros(20, dtype=bool)),
            "/frames/known_range_m",
        ),
        (
            dataclasses.replace(
                moved(np.linspace(0.0, 1.0, 20), 0.01), object_present=np.arange(20) > 0
            ),
            "/frames/displacement_m",
        ),
    ],
)
def test_frames_that_no_border_has_checked(frames: Frames, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        fold.prepare(SENSOR, parse_scene({}), frames, QUICK)
    assert pointer in {problem.pointer for problem in caught.value.problems}


def test_what_does_not_move_has_no_displacement() -> None:
    with pytest.raises(InvalidInputError) as caught:
        fold.prepare(SENSOR, parse_scene({"motion": "static"}), moved(np.zeros(20), 0.01), QUICK)
    assert [problem.pointer for problem in caught.value.problems] == ["/frames/displacement_m"]
    many = Frames(np.tile(FRAMES.readings, (40, 1)))
    many = dataclasses.replace(many, displacement_m=np.zeros(800), displacement_sd_m=np.ones(800))
    with pytest.raises(RefusedError, match="displacements posteriors take 600"):
        fold.prepare(SENSOR, parse_scene({}), many, QUICK)


@pytest.mark.parametrize(
    ("scene", "pointer"),
    [
        ({"object": {"c0": {"prior": "loguniform", "low": 0.0, "high": 1.0}}}, "/object/c0/low"),
        ({"object": {"c0": {"prior": "uniform", "low": 1.0, "high": 1.0}}}, "/object/c0"),
        (
            {"object": {"c2": {"prior": "lognormal", "median": 0.1, "sigma": 0.0}}},
            "/object/c2/sigma",
        ),
        ({"range_m": {"prior": "uniform", "low": 0.0, "high": np.inf}}, "/range_m/high"),
        ({"crosstalk": [{"prior": "normal", "mean": np.nan, "sd": 1.0}, 0.0]}, "/crosstalk/0/mean"),
        ({"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": np.inf}, 0.0]}, "/crosstalk/0/sd"),
    ],
)
def test_improper_priors_are_not_even_scenes(scene: dict[str, Any], pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        parse_scene(scene)
    assert any(problem.pointer.startswith(pointer) for problem in caught.value.problems)


@pytest.mark.parametrize(
    ("scene", "pointer"),
    [
        (
            {
                "object": {
                    "c0": {"prior": "uniform", "low": 1e-6, "high": 1e-4},
                    "c1": {"prior": "uniform", "low": -10.0, "high": -5.0},
                }
            },
            "/scene/object/c1",
        ),
        ({"object": {"c2": {"prior": "uniform", "low": -2.0, "high": -1.0}}}, "/scene/object/c2"),
        ({"range_m": {"prior": "uniform", "low": 100.0, "high": 200.0}}, "/scene/range_m"),
        ({"range_m": {"prior": "stroke", "low": 100.0, "high": 200.0}}, "/scene/range_m/low"),
        ({"background": {"strength": 0.1, "distance_m": 99.0}}, "/scene/background/distance_m"),
        ({"crosstalk": {"values": [0.0, 0.1], "optional": True}}, "/scene/crosstalk/optional"),
        (
            {
                "background": {
                    "strength": 0.1,
                    "distance_m": 9.0,
                    "shadow": {"c0": 0.05, "c1": 0.0},
                    "optional": True,
                }
            },
            "/scene/background/optional",
        ),
    ],
)
def test_priors_that_physics_or_reason_excludes_are_named(
    scene: dict[str, Any], pointer: str
) -> None:
    with pytest.raises(InvalidInputError) as caught:
        fold.prepare(SENSOR, parse_scene(scene), FRAMES, QUICK)
    assert pointer in {problem.pointer for problem in caught.value.problems}


REMEDIES: dict[str, tuple[dict[str, Any], str]] = {
    "priors of c0 and c1 that all but exclude one another": (
        {
            "object": {
                "c0": {"prior": "lognormal", "median": 1e-12, "sigma": 0.1},
                "c1": {"prior": "normal", "mean": -1.0, "sd": 0.1},
            }
        },
        "bring them into agreement",
    ),
    "a shadow that leaves no range": (
        {
            "background": {
                "strength": 0.02,
                "distance_m": 3.0,
                "shadow": {"c0": 900.0, "c1": -59.0},
            },
        },
        "raise `background.shadow.c1`",
    ),
    "an amplitude that changes": ({"motion": "tangential"}, "differential"),
    "a discrepancy at one range": (
        {"motion": "static", "discrepancy": 0.05},
        "leave `discrepancy`",
    ),
}


@pytest.mark.parametrize("name", REMEDIES)
def test_scenes_without_an_honest_answer_are_refused_with_the_remedy(name: str) -> None:
    scene, remedy = REMEDIES[name]
    with pytest.raises(RefusedError, match=remedy):
        fold.prepare(SENSOR, parse_scene(scene), FRAMES, QUICK)


def test_more_unknowns_than_were_tested_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = {
        "crosstalk": UNKNOWN_CROSSTALK,
        "range_m": {"prior": "stroke", "low": 0.1, "high": 5.0},
    }
    scene["background"] = {
        "strength": {"prior": "loguniform", "low": 1e-4, "high": 1.0},
        "distance_m": {"prior": "uniform", "low": 1.0, "high": 10.0},
    }
    largest = fold.prepare(SENSOR, parse_scene(scene), FRAMES, QUICK)
    assert len(largest.density().parameters) == checks.MOST_UNKNOWNS == 11
    monkeypatch.setattr(checks, "MOST_UNKNOWNS", 10)
    with pytest.raises(RefusedError, match="as known numbers"):
        fold.prepare(SENSOR, parse_scene(scene), FRAMES, QUICK)


def test_more_frames_than_were_tested_are_refused() -> None:
    most = checks.MOST_FRAMES // len(FRAMES)
    many = Frames(np.tile(FRAMES.readings, (most, 1)))
    assert fold.prepare(SENSOR, parse_scene({}), many, QUICK).usable.all()
    more = Frames(np.tile(FRAMES.readings, (most + 1, 1)))
    with pytest.raises(RefusedError, match="several posteriors of a part each"):
        fold.prepare(SENSOR, parse_scene({}), more, QUICK)


@pytest.mark.parametrize(
    ("scene", "remedy"),
    [
        ({"motion": "static"}, "means of 2 frames each"),
        ({"discrepancy": 0.05}, "leave `discrepancy` out"),
        ({"crosstalk": {"values": UNKNOWN_CROSSTALK, "optional": True}}, "leave `optional` out"),
    ],
)
def test_more_frames_than_can_be_computed_together_are_refused(
    scene: dict[str, Any], remedy: str
) -> None:
    many = Frames(np.tile(FRAMES.readings, (checks.MOST_COUPLED // len(FRAMES) + 1, 1)))
    with pytest.raises(RefusedError, match=remedy):
        fold.prepare(SENSOR, parse_scene(scene), many, QUICK)
    some = many.select(slice(0, checks.MOST_COUPLED))
    assert fold.prepare(SENSOR, parse_scene(scene), some, QUICK).usable.all()


def test_frames_that_are_all_saturated_are_refused() -> None:
    sensor = parse_sensor({**SENSOR.model_dump(exclude_none=True), "full_scale": [1e-9, 1e-9]})
    with pytest.raises(RefusedError, match="lower the gain or the exposure"):
        fold.prepare(sensor, parse_scene({}), FRAMES, QUICK)


@pytest.mark.parametrize("crosstalk", [None, [0.0, 0.0]])
def test_empty_frames_that_can_teach_nothing_are_refused(crosstalk: Any) -> None:
    empty = dataclasses.replace(FRAMES, object_present=np.zeros(20, dtype=bool))
    with pytest.raises(RefusedError, match="object_present"):
        fold.prepare(SENSOR, parse_scene({"crosstalk": crosstalk}), empty, QUICK)


@pytest.mark.parametrize("value", [1e160, 1e300])
def test_readings_beyond_any_number_are_refused_before_sampling(value: float) -> None:
    job = fold.prepare(SENSOR, parse_scene({}), with_reading(value), QUICK)
    with pytest.raises(RefusedError, match="noise's `read`"):
        begin(job, Starting())


def test_a_reading_a_million_times_its_noise_away_is_refused_before_sampling() -> None:
    job = fold.prepare(SENSOR, parse_scene({}), with_reading(1e3), QUICK)
    with pytest.raises(RefusedError, match=r"number 3 \(from 0\): check the units"):
        begin(job, Starting())


WRONG: dict[str, Callable[[], tuple[dict[str, Any], Frames]]] = {
    "crosstalk far outside its prior": lambda: (
        {"object": OBJECT, "crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 1e-9}] * 2},
        data(SENSOR, {"crosstalk": [0.002, 0.01]}).frames,
    ),
    "an object far brighter than its prior": lambda: (
        {"object": OBJECT | {"c2": {"prior": "lognormal", "median": 1e-6, "sigma": 0.1}}},
        data(SENSOR, frames=8).frames,
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_priors_and_readings_that_contradict_one_another_are_named(name: str) -> None:
    """A misfit of the model, of which the prior is a part; the draws are what was stated."""
    scene, frames = WRONG[name]()
    posterior = infer(SENSOR, parse_scene(scene), frames, QUICK)
    assert posterior.fit.misfit
    assert posterior.verdict.converged, posterior.verdict.reasons


WEIGHTED = SamplerSettings(seed=3, method="importance")
SEEN = data(SENSOR, {"crosstalk": [0.002, 0.01]}).frames


@functools.cache
def in_one_unit() -> Posterior:
    scene = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.02}] * 2}
    return infer(SENSOR, parse_scene(scene), SEEN, WEIGHTED)


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_no_answer_depends_on_the_unit_of_readings(factor: float) -> None:
    scaled = {"crosstalk": [{"prior": "normal", "mean": 0.0, "sd": 0.02 * factor}] * 2}
    noise = {"read": [read * factor for read in SENSOR.noise.read]}
    sensor = parse_sensor({**SENSOR.model_dump(exclude_none=True), "gain": factor, "noise": noise})
    plain = in_one_unit()
    other = infer(sensor, parse_scene(scaled), Frames(SEEN.readings * factor), WEIGHTED)
    # rounding differs, and each step of a climb multiplies it; draws themselves are as good as 1 %
    assert other.range_m.q50 == pytest.approx(plain.range_m.q50, rel=1e-4)
    assert other.parameters["object.c0"].mean == pytest.approx(
        plain.parameters["object.c0"].mean, rel=1e-3
    )
    assert other.parameters["crosstalk.w1"].mean == pytest.approx(
        factor * plain.parameters["crosstalk.w1"].mean, rel=1e-3
    )
