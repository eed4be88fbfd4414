"""The scene language: what parses, and what each mistake is called."""

import json
import math
import pickle
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.errors import InvalidInputError, Problem
from simulator.frames import frames_from_columns
from simulator.parameters import parameters_of
from simulator.scene import Scene, parse_scene
from simulator.scene_checks import check_scene
from simulator.sensor import parse_sensor

NOISE = {"read": [1e-6, 1e-6]}
PULSED = {"kind": "pulsed", "pulse_width_s": 1e-7, "noise": NOISE}
SINE = {"kind": "sine_wave", "frequency_hz": 5e6, "noise": NOISE}
FULL = {
    "object": {
        "c0": 0.0769,
        "c1": -0.123,
        "c2": {"prior": "lognormal", "median": 0.1, "sigma": 1.0},
    },
    "crosstalk": [0.02, 0.5],
    "background": {"strength": 0.8, "distance_m": 3.0, "shadow": {"c0": 0.056, "c1": 0.013}},
    "range_m": {"prior": "uniform", "low": 0.02, "high": 5.0},
    "motion": "radial",
    "discrepancy": 0.05,
}


@pytest.mark.parametrize(
    "document", [{}, FULL, {"crosstalk": {"values": [0, 1], "optional": True}}]
)
def test_scenes_survive_the_way_through_json(document: dict[str, Any]) -> None:
    scene = parse_scene(document)
    assert Scene.model_validate_json(scene.model_dump_json()) == scene
    assert parse_scene(json.loads(scene.model_dump_json(exclude_unset=True))) == scene


@pytest.mark.parametrize(
    ("document", "pointer"),
    [
        ({"object": {"c0": -1.0}}, "/object/c0"),
        ({"object": {"c0": 1.0, "c1": -2.0}}, "/object/c1"),
        ({"object": {"c0": "1.5"}}, "/object/c0"),
        ({"object": {"c0": True}}, "/object/c0"),
        ({"object": {"c0": math.nan}}, "/object/c0"),
        ({"object": {"c0": {"prior": "uniform", "low": 3, "high": 2}}}, "/object/c0"),
        ({"object": {"c0": {"prior": "uniform", "low": 0, "high": 1}, "c1": -3}}, "/object/c1"),
        ({"object": {"c0": {"prior": "flat"}}}, "/object/c0/prior"),
        ({"object": {"c0": {"median": 1}}}, "/object/c0/prior"),
        ({"crosstalk": [1.0]}, "/crosstalk/1"),
        ({"crosstalk": 3}, "/crosstalk"),
        ({"background": {"strength": 1.0}}, "/background/distance_m"),
        ({"background": {"strength": 1.0, "distance_m": 20.0}}, "/background/distance_m"),
        ({"range_m": {"prior": "uniform", "low": 16.0, "high": 20.0}}, "/range_m"),
        ({"motion": "sideways"}, "/motion"),
        ({"wall": 1}, "/wall"),
    ],
)
def test_each_mistake_in_a_scene_names_its_field(document: Any, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        check_scene(parse_sensor(PULSED), parse_scene(document))
    assert pointer in [problem.pointer for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("change", "pointer"),
    [
        ({"kind": "lidar"}, "/kind"),
        ({"pulse_width_s": 0.0}, "/pulse_width_s"),
        ({"noise": {"read": [1e-6, -1.0]}}, "/noise/read/1"),
        ({"noise": {"read": [1e-6]}}, "/noise/read/1"),
        ({"noise": {}}, "/noise/read"),
        ({"frequency_hz": 1e6}, "/frequency_hz"),
    ],
)
def test_each_mistake_in_a_sensor_names_its_field(change: dict[str, Any], pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        parse_sensor({**PULSED, **change})
    assert pointer in [problem.pointer for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("columns", "pointer"),
    [
        ({"w1": [1.0]}, "/w2"),
        ({"w1": [], "w2": []}, "/w1"),
        ({"w1": [1.0], "w2": [1.0, 2.0]}, "/w2"),
        ({"w1": [1.0], "w2": [math.inf]}, "/w2"),
        ({"w1": [[1.0]], "w2": [1.0]}, "/w1"),
        ({"w1": ["a"], "w2": [1.0]}, "/w1"),
        ({"w1": [1.0], "w2": [1.0], "i": [1.0]}, "/i"),
        ({"w1": [1.0], "w2": [1.0], "gain": [0.0]}, "/gain"),
        ({"w1": [1.0], "w2": [1.0], "object_present": [1.0]}, "/object_present"),
        ({"w1": [1.0], "w2": [1.0], "dw1_dt": [1.0]}, "/dw2_dt"),
    ],
)
def test_each_mistake_in_frames_names_its_column(columns: Any, pointer: str) -> None:
    with pytest.raises(InvalidInputError) as caught:
        frames_from_columns(parse_sensor(PULSED), columns)
    assert pointer in [problem.pointer for problem in caught.value.problems]


_json = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.sampled_from([*FULL, "c0", "c1", "prior", "low", "high", "strength", "x"]),
            inner,
            max_size=3,
        )
    ),
    max_leaves=12,
)


@given(_json)
def test_any_json_is_a_scene_or_names_what_is_wrong(document: Any) -> None:
    problems: tuple[Problem, ...] = ()
    names: tuple[str, ...] = ()
    try:
        names = parameters_of(parse_sensor(SINE), parse_scene(document)).names
    except InvalidInputError as error:
        problems = error.problems
    assert bool(problems) != bool(names)


def test_errors_survive_the_way_between_processes() -> None:
    error = InvalidInputError(Problem("/a", "x"), Problem("/b", "y"))
    assert pickle.loads(pickle.dumps(error)).problems == error.problems  # noqa: S301


def test_what_a_scene_lacks_has_no_parameter() -> None:
    sensor = parse_sensor(PULSED)
    assert parameters_of(sensor, parse_scene({})).names == ("object.c0", "object.c1", "object.c2")
    known = {"object": {"c0": 0.1, "c1": 0.0, "c2": 0.1}}
    assert parameters_of(sensor, parse_scene(known)).names == ()
    wall = {**known, "background": {"strength": 1.0, "distance_m": 3.0}}
    names = parameters_of(sensor, parse_scene(wall)).names
    assert names == ("background.shadow.c0", "background.shadow.c1")
