"""Any JSON is valid, or what is wrong with it is named by a pointer that leads somewhere."""

import copy
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from simulator.errors import InvalidInputError, Problem
from simulator.scene import Background, ObjectTerm, Scene, parse_scene
from simulator.scene_checks import check_scene
from simulator.sensor import parse_sensor
from tests.simulator.documents import LAWS, SCENES, SENSORS
from tests.simulator.pointers import leads_somewhere

NAMES = sorted(
    {name for law in LAWS.values() for name in law}
    | set(SENSORS["pulsed"])
    | set(SENSORS["sine_wave"])
    | set(Scene.model_fields)
    | set(ObjectTerm.model_fields)
    | set(Background.model_fields)
    | {"values", "read", "shot", "a/b", "~"}
)
WORDS = [*LAWS, *SENSORS, "stroke", "reference", "object", "radial"]
numbers = st.floats() | st.integers(-(2**70), 2**70) | st.just(10**400)
scalars = st.none() | st.booleans() | numbers | st.text(max_size=4) | st.sampled_from(WORDS)
anything = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(NAMES), inner, max_size=4)
    ),
    max_leaves=10,
)
examples = st.sampled_from([*SCENES, *SENSORS.values()])


def _places(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    children: Any = []
    if isinstance(value, dict):
        children = value.items()
    elif isinstance(value, list):
        children = enumerate(value)
    return [way, *(place for key, child in children for place in _places(child, (*way, key)))]


@st.composite
def spoiled(draw: st.DrawFn) -> Any:
    """Draw a valid document with one part replaced, or with one member more."""
    document = copy.deepcopy(draw(examples))
    way = draw(st.sampled_from(_places(document)))
    if not way:
        return draw(anything)
    here: Any = document
    for key in way[:-1]:
        here = here[key]
    last = way[-1]
    if isinstance(here, dict) and draw(st.booleans()):
        last = draw(st.sampled_from(NAMES))
    here[last] = draw(anything)
    return document


@settings(deadline=None)
@given(spoiled() | anything, st.sampled_from([parse_scene, parse_sensor]))
def test_any_json_is_valid_or_named(document: Any, parse_one: Any) -> None:
    problems: tuple[Problem, ...] = ()
    try:
        assert parse_one(document).model_dump()
    except InvalidInputError as error:
        problems = error.problems
    else:
        return
    assert problems
    for problem in problems:
        assert problem.message
        assert leads_somewhere(problem.pointer, document), problem


@settings(deadline=None)
@given(spoiled())
def test_any_scene_passes_the_check_or_is_named(document: Any) -> None:
    for kind in SENSORS:
        problems: tuple[Problem, ...] = ()
        try:
            check_scene(parse_sensor(SENSORS[kind]), parse_scene(document))
        except InvalidInputError as error:
            problems = error.problems
        assert all(leads_somewhere(problem.pointer, document) for problem in problems)
