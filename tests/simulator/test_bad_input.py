"""Whatever is wrong with a sensor, a scene, frames or a trajectory, the answer names the field."""

import copy
import json
import math
import pickle
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simulator.errors import HybridTofError, InvalidInputError, Problem, RefusedError
from simulator.frames import FrameColumns
from simulator.scene import Background, ObjectTerm, Scene, Shadow, Stroke, parse_scene
from simulator.scene_checks import check_scene
from simulator.sensor import parse_sensor
from simulator.trajectories import RadialTrajectory, SampledTrajectory
from simulator.validated import parse
from tests.simulator.documents import LAWS, SCENES, SENSORS, WALL
from tests.simulator.pointers import leads_somewhere

NOISE: dict[str, Any] = {"read": [1e-6, 1e-6]}


@pytest.mark.parametrize("document", SENSORS.values(), ids=SENSORS)
def test_sensors_survive_the_way_through_json(document: dict[str, Any]) -> None:
    sensor = parse_sensor(document)
    for written in (sensor.model_dump_json(), sensor.model_dump_json(exclude_none=True)):
        assert parse_sensor(json.loads(written)) == sensor
    assert json.loads(sensor.model_dump_json(exclude_unset=True)) == document


@pytest.mark.parametrize("kind", SENSORS)
@pytest.mark.parametrize("document", SCENES, ids=str)
def test_scenes_of_the_documents(kind: str, document: dict[str, Any]) -> None:
    scene = parse_scene(document)
    check_scene(parse_sensor(SENSORS[kind]), scene)
    for written in (scene.model_dump_json(), scene.model_dump_json(exclude_none=True)):
        assert parse_scene(json.loads(written)) == scene
    assert json.loads(scene.model_dump_json(exclude_unset=True)) == document
    assert parse_scene(copy.deepcopy(document)) == scene


def test_scenes_made_in_python_are_those_of_json() -> None:
    wall = Background(strength=0.8, distance_m=3.0, shadow=Shadow(c0=0.056))
    made = Scene(object=ObjectTerm(c0=0.08), background=wall, range_m=Stroke(low=0.1, high=2.0))
    document = {
        "object": {"c0": 0.08},
        "background": WALL | {"shadow": {"c0": 0.056}},
        "range_m": {"prior": "stroke", "low": 0.1, "high": 2.0},
    }
    assert parse_scene(document) == made
    assert parse_scene(json.loads(made.model_dump_json())) == made


def test_scenes_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="frozen"):
        setattr(parse_scene({}), "motion", "static")  # noqa: B010  # a type checker sees it too


def _pointers(error: InvalidInputError) -> list[str]:
    return [problem.pointer for problem in error.problems]


@pytest.mark.parametrize(
    ("kind", "change", "pointer"),
    [
        *(
            ("pulsed", {"pulse_width_s": bad}, "/pulse_width_s")
            for bad in (0, -1e-7, math.nan, math.inf, "1e-7", True, None, [1e-7], 10**400)
        ),
        ("pulsed", {"gain": 0.0}, "/gain"),
        ("pulsed", {"gain": -math.inf}, "/gain"),
        ("pulsed", {"noise": NOISE | {"read": [0.0, 1e-6]}}, "/noise/read/0"),
        ("pulsed", {"noise": NOISE | {"read": [1e-6, math.nan]}}, "/noise/read/1"),
        ("pulsed", {"noise": NOISE | {"read": 1e-6}}, "/noise/read"),
        ("pulsed", {"noise": NOISE | {"read": [1.0, 1.0, 1.0]}}, "/noise/read"),
        ("pulsed", {"noise": NOISE | {"shot": -1e-9}}, "/noise/shot"),
        ("pulsed", {"noise": NOISE | {"relative": math.inf}}, "/noise/relative"),
        ("pulsed", {"noise": NOISE | {"derivative": [1.0]}}, "/noise/derivative/1"),
        ("pulsed", {"noise": NOISE | {"dark": 1.0}}, "/noise/dark"),
        ("pulsed", {"noise": None}, "/noise"),
        ("pulsed", {"full_scale": [1.0, 0.0]}, "/full_scale/1"),
        ("pulsed", {"full_scale": {"w1": 1.0}}, "/full_scale"),
        ("pulsed", {"phase_offset_rad": 0.0}, "/phase_offset_rad"),
        ("pulsed", {"a/b~c": 0.0}, "/a~1b~0c"),
        ("pulsed", {"kind": None}, "/kind"),
        ("pulsed", {"kind": ["pulsed"]}, "/kind"),
        ("sine_wave", {"frequency_hz": 0.0}, "/frequency_hz"),
        ("sine_wave", {"phase_offset_rad": math.nan}, "/phase_offset_rad"),
    ],
)
def test_a_wrong_member_of_a_sensor(kind: str, change: dict[str, Any], pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        parse_sensor(SENSORS[kind] | change)
    assert _pointers(caught.value) == [pointer]


@pytest.mark.parametrize(
    ("document", "pointer"), [({}, "/kind"), ([], ""), (None, ""), ("pulsed", ""), (3, "")]
)
def test_what_is_no_sensor(document: Any, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        parse_sensor(document)
    assert _pointers(caught.value) == [pointer]


@pytest.mark.parametrize("missing", ["kind", "pulse_width_s", "noise"])
def test_a_missing_member_of_a_sensor(missing: str) -> None:
    document = {name: value for name, value in SENSORS["pulsed"].items() if name != missing}
    with pytest.raises(InvalidInputError) as caught:
        parse_sensor(document)
    assert _pointers(caught.value) == [f"/{missing}"]


def _without(law: str, member: str) -> dict[str, Any]:
    return {name: value for name, value in LAWS[law].items() if name != member}


PRIORS_THAT_FAIL: list[tuple[Any, str]] = [
    ({}, "/prior"),
    ({"prior": None}, "/prior"),
    ({"prior": []}, "/prior"),
    ({"prior": "gamma", "low": 1.0}, "/prior"),
    *((_without(law, member), f"/{member}") for law in LAWS for member in LAWS[law]),
    (LAWS["uniform"] | {"mean": 1.0}, "/mean"),
    (LAWS["uniform"] | {"low": 5.0}, ""),
    (LAWS["uniform"] | {"low": math.nan}, "/low"),
    (LAWS["uniform"] | {"low": -1.7e308}, "/low"),
    (LAWS["loguniform"] | {"low": 1e-51}, "/low"),
    (LAWS["loguniform"] | {"low": 0.0}, "/low"),
    (LAWS["loguniform"] | {"low": 6.0}, ""),
    (LAWS["normal"] | {"sd": 0.0}, "/sd"),
    (LAWS["normal"] | {"mean": "1"}, "/mean"),
    (LAWS["halfnormal"] | {"sd": -1.0}, "/sd"),
    (LAWS["lognormal"] | {"median": 0.0}, "/median"),
    (LAWS["lognormal"] | {"sigma": math.inf}, "/sigma"),
    (LAWS["truncated_normal"] | {"high": 0.5}, ""),
    (LAWS["truncated_normal"] | {"sd": 1e-300}, "/sd"),
    (LAWS["truncated_normal"] | {"sd": 1e-40}, "no mass"),
    (LAWS["lognormal"] | {"sigma": 101.0}, "/sigma"),
]


@pytest.mark.parametrize(("law", "pointer"), PRIORS_THAT_FAIL, ids=str)
@pytest.mark.parametrize("place", ["object/c0", "crosstalk/1", "background/strength", "range_m"])
def test_a_wrong_prior_wherever_it_stands(place: str, law: Any, pointer: str) -> None:
    if pointer == "no mass":  # both ends lie more than 1e39 standard deviations above the mean
        law, pointer = law | {"low": 1.5}, ""
    document: dict[str, Any] = {
        "object": {},
        "crosstalk": [0.0, 0.0],
        "background": dict(WALL),
    }
    term, *member = place.split("/")
    if term == "crosstalk":
        document[term][1] = law
    elif member:
        document[term][member[0]] = law
    else:
        document[term] = law
    with pytest.raises(InvalidInputError) as caught:
        parse_scene(document)
    assert _pointers(caught.value) == [f"/{place}{pointer}"]


@pytest.mark.parametrize(
    ("document", "pointer"),
    [
        ([], ""),
        (None, ""),
        ({"object": None}, "/object"),
        ({"object": []}, "/object"),
        ({"object": {"c3": 1.0}}, "/object/c3"),
        ({"object": {"c2": 0.0}}, "/object/c2"),
        ({"object": {"c0": 0.0}}, "/object/c0"),
        ({"object": {"c0": 0.04, "c1": -0.4}}, "/object/c1"),
        ({"object": {"c0": LAWS["uniform"] | {"low": -2.0, "high": -1.0}}}, "/object/c0"),
        ({"object": {"c0": 1.0, "c1": LAWS["uniform"] | {"low": -9, "high": -2}}}, "/object/c1"),
        ({"crosstalk": "ab"}, "/crosstalk"),
        ({"crosstalk": [1.0, 2.0, 3.0]}, "/crosstalk"),
        ({"crosstalk": [math.inf, 0.0]}, "/crosstalk/0"),
        ({"crosstalk": {"values": [0.0, "x"]}}, "/crosstalk/values/1"),
        ({"crosstalk": {"values": [0.0, 0.0], "optional": 1}}, "/crosstalk/optional"),
        ({"crosstalk": {"optional": True}}, "/crosstalk/values"),
        ({"background": []}, "/background"),
        ({"background": {"distance_m": 3.0}}, "/background/strength"),
        ({"background": WALL | {"strength": 0.0}}, "/background/strength"),
        ({"background": WALL | {"distance_m": -3.0}}, "/background/distance_m"),
        ({"background": WALL | {"distance_m": 14.99}}, "/background/distance_m"),
        (
            {"background": WALL | {"distance_m": {"prior": "uniform", "low": 15.0, "high": 20.0}}},
            "/background/distance_m",
        ),
        ({"background": WALL | {"shadow": "wall"}}, "/background/shadow"),
        ({"background": WALL | {"shadow": 1.0}}, "/background/shadow"),
        ({"background": WALL | {"shadow": {"c0": -1.0}}}, "/background/shadow/c0"),
        ({"background": WALL | {"shadow": {"c0": 1.0, "c1": -2.5}}}, "/background/shadow/c1"),
        ({"background": WALL | {"shadow": {"c2": 1.0}}}, "/background/shadow/c2"),
        ({"range_m": 0.5}, "/range_m"),
        ({"range_m": {"prior": "stroke", "low": 0.1}}, "/range_m/high"),
        ({"range_m": {"prior": "stroke", "low": 3.0, "high": 1.0}}, "/range_m"),
        ({"range_m": {"prior": "stroke", "low": 15.0, "high": 16.0}}, "/range_m/low"),
        ({"range_m": {"prior": "reference", "high": 1.0}}, "/range_m/low"),
        ({"range_m": {"prior": "reference", "low": 3.0, "high": 1.0}}, "/range_m"),
        ({"range_m": {"prior": "reference", "low": 15.0, "high": 16.0}}, "/range_m/low"),
        ({"range_m": LAWS["uniform"] | {"low": -2.0, "high": -1.0}}, "/range_m"),
        ({"motion": None}, "/motion"),
        ({"motion": ["radial"]}, "/motion"),
        ({"discrepancy": -0.1}, "/discrepancy"),
        ({"discrepancy": math.inf}, "/discrepancy"),
        ({"discrepancy": "measured"}, "/discrepancy"),
        ({"discrepancy": {}}, "/discrepancy"),
        ({"discrepancy": {"flux": -0.1}}, "/discrepancy/flux"),
        ({"discrepancy": {"range_m": math.nan}}, "/discrepancy/range_m"),
        ({"discrepancy": {"range_m": 15.0}}, "/discrepancy/range_m"),
        (
            {
                "discrepancy": {"range_m": 0.8},
                "range_m": {"prior": "reference", "low": 0.1, "high": 0.9},
            },
            "/discrepancy/range_m",
        ),
        ({"discrepancy": {"range": 0.001}}, "/discrepancy/range"),
    ],
    ids=str,
)
def test_a_wrong_member_of_a_scene(document: Any, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        check_scene(parse_sensor(SENSORS["pulsed"]), parse_scene(document))
    assert _pointers(caught.value) == [pointer]
    assert leads_somewhere(pointer, document)


def test_a_sine_wave_has_no_farthest_background() -> None:
    scene = parse_scene({"background": WALL | {"distance_m": 50.0}})
    check_scene(parse_sensor(SENSORS["sine_wave"]), scene)


def test_every_mistake_is_named_at_once() -> None:
    document = {"object": {"c0": -1.0, "c2": -1.0}, "background": WALL | {"strength": -1.0}}
    with pytest.raises(InvalidInputError) as caught:
        check_scene(parse_sensor(SENSORS["pulsed"]), parse_scene(document))
    assert _pointers(caught.value) == ["/object/c0", "/object/c2", "/background/strength"]


@pytest.mark.parametrize("least", [-0.2828427, -0.2828428])
def test_joint_priors_are_refused_only_where_nothing_is_left(least: float) -> None:
    """-2 sqrt(c0) reaches down to -0.28284271 where c0 reaches up to 0.02."""
    c0 = {"prior": "uniform", "low": 0.01, "high": 0.02}
    for c1 in (least, {"prior": "uniform", "low": -10.0, "high": least}):
        scene = parse_scene({"object": {"c0": c0, "c1": c1}})
        if least > -2 * math.sqrt(0.02):
            check_scene(parse_sensor(SENSORS["pulsed"]), scene)
        else:
            with pytest.raises(InvalidInputError) as caught:
                check_scene(parse_sensor(SENSORS["pulsed"]), scene)
            assert _pointers(caught.value) == ["/object/c1"]


@settings(deadline=None)
@given(st.floats(1e-50, 1e50))
def test_every_known_c1_above_its_limit_is_accepted_and_none_below(c0: float) -> None:
    limit = -2 * math.sqrt(c0)
    sensor = parse_sensor(SENSORS["pulsed"])
    check_scene(sensor, parse_scene({"object": {"c0": c0, "c1": math.nextafter(limit, 0.0)}}))
    with pytest.raises(InvalidInputError):
        check_scene(sensor, parse_scene({"object": {"c0": c0, "c1": limit}}))


@pytest.mark.parametrize(
    ("model", "document", "pointer"),
    [
        (FrameColumns, {"w1": [1.0], "w3": [1.0]}, "/w3"),
        (FrameColumns, {"w1": [1.0, math.nan]}, "/w1/1"),
        (FrameColumns, {"w1": 1.0}, "/w1"),
        (FrameColumns, {"gain": [1.0, 0.0]}, "/gain/1"),
        (FrameColumns, {"object_present": [True, 0]}, "/object_present/1"),
        *((FrameColumns, {name: ["x"] * 1000}, f"/{name}/0") for name in FrameColumns.model_fields),
        (FrameColumns, {"gain": [1.0] * 2_000_001}, "/gain"),
        (FrameColumns, {"object_present": [True] * 2_000_001}, "/object_present"),
        (SampledTrajectory, {}, "/range_m"),
        (SampledTrajectory, {"range_m": []}, "/range_m"),
        (SampledTrajectory, {"range_m": [1.0, -1.0, -1.0]}, "/range_m/1"),
        (SampledTrajectory, {"range_m": [1.0], "time_s": [0.0, 1.0]}, "/time_s"),
        (SampledTrajectory, {"range_m": [1.0], "amplitude": [0.0]}, "/amplitude/0"),
        (SampledTrajectory, {"range_m": [1.0], "object_present": []}, "/object_present"),
        (SampledTrajectory, {"range_m": [1.0] * 1_000_001}, "/range_m"),
        (RadialTrajectory, {"from_m": 1.0, "to_m": 2.0}, "/frames"),
        (RadialTrajectory, {"from_m": 0.0, "to_m": 2.0, "frames": 2}, "/from_m"),
        (RadialTrajectory, {"from_m": 1.0, "to_m": 2.0, "frames": 0}, "/frames"),
        (RadialTrajectory, {"from_m": 1.0, "to_m": 2.0, "frames": 2.0}, "/frames"),
        (RadialTrajectory, {"from_m": 1.0, "to_m": 2.0, "frames": 10**7}, "/frames"),
        (
            RadialTrajectory,
            {"from_m": 1.0, "to_m": 2.0, "frames": 2, "spacing": "even"},
            "/spacing",
        ),
    ],
    ids=lambda value: str(value)[:60],
)
def test_a_wrong_column_or_trajectory(model: Any, document: Any, pointer: str) -> None:
    """A long bad column gives one problem, not one for each entry."""
    with pytest.raises(InvalidInputError) as caught:
        parse(model, document)
    assert _pointers(caught.value) == [pointer]


def test_errors_say_where_and_what() -> None:
    error = InvalidInputError(Problem("", "is empty"), Problem("/a", "is wrong"))
    assert str(error) == "/: is empty; /a: is wrong"
    assert str(error.below("/scene")) == "/scene: is empty; /scene/a: is wrong"
    assert InvalidInputError.at("/a", "is wrong").problems == error.problems[1:]
    assert isinstance(error, ValueError)
    assert isinstance(error, HybridTofError)
    again = pickle.loads(pickle.dumps(error.below("/x")))  # noqa: S301
    assert (str(again), again.problems) == (str(error.below("/x")), error.below("/x").problems)
    refused = pickle.loads(pickle.dumps(RefusedError("too little")))  # noqa: S301
    assert isinstance(refused, RefusedError)
    assert str(refused) == "too little"
