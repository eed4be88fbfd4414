"""The shapes of answers: those recorded before they were derived still fit, and no others do."""

import copy
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray
from typing_extensions import TypeAliasType, TypeVar

from service.answers.shape import Shape, model_of
from service.app import create_app
from service.service_settings import ServiceSettings

RECORDED: dict[str, list[Any]] = json.loads(
    Path(__file__).with_name("recorded_answers.json").read_text(encoding="utf-8")
)
# of these members OpenAPI says no more than that they are objects
FREE = ("/truth", "/problem")


@pytest.fixture(scope="module")
def document(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    database = f"sqlite:///{tmp_path_factory.mktemp('jobs')}/jobs.sqlite"
    return create_app(ServiceSettings(workers=1, database=database)).openapi()


def validator(document: dict[str, Any], operation: str) -> jsonschema.Draft202012Validator:
    method, path = operation.split()
    responses = document["paths"][path][method]["responses"]
    (good,) = (response for status, response in responses.items() if status.startswith("2"))
    schema = good["content"]["application/json"]["schema"]
    return jsonschema.Draft202012Validator(schema | {"components": document["components"]})


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    if isinstance(value, dict):
        for name, member in value.items():
            yield from leaves(member, (*path, name))
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from leaves(entry, (*path, index))
    else:
        yield path


@pytest.mark.parametrize("operation", RECORDED)
def test_recorded_answers_fit(document: dict[str, Any], operation: str) -> None:
    check = validator(document, operation)
    for answer in RECORDED[operation]:
        assert list(check.iter_errors(answer)) == []


@pytest.mark.parametrize("operation", RECORDED)
def test_spoiled_answers_do_not(document: dict[str, Any], operation: str) -> None:
    """An array where there was a number or a text, once at every kind of place."""
    check = validator(document, operation)
    for answer in RECORDED[operation]:
        kinds = {
            tuple("*" if isinstance(part, int) else part for part in path): path
            for path in leaves(answer)
            if not ("/" + str(path[0])).startswith(FREE)
        }
        for path in kinds.values():
            spoiled = copy.deepcopy(answer)
            target = spoiled
            for part in path[:-1]:
                target = target[part]
            target[path[-1]] = [[]]
            assert not check.is_valid(spoiled), path
        for name in answer:
            rest = {other: value for other, value in answer.items() if other != name}
            assert not check.is_valid(rest) or operation == "get /health/live", name


Array = NDArray[np.float64]


@dataclasses.dataclass
class Inner:
    """One part."""

    mean: float
    name: str


@dataclasses.dataclass
class Outer:
    """A whole.

    Attributes are not told.
    """

    parts: tuple[Inner, ...]
    by_name: dict[str, Inner]
    values: Array
    flags: NDArray[np.bool_]
    maybe: float | None
    kind: Literal["a", "b"]
    hidden: Array


SHAPES = {
    Inner: Shape(missing=frozenset({"mean"}), types={"name": Literal["x"]}),
    Outer: Shape(without=frozenset({"hidden"})),
}
GOOD: dict[str, Any] = {
    "parts": [{"mean": None, "name": "x"}],
    "by_name": {"q": {"mean": 1.0, "name": "x"}},
    "values": [1.0, None],
    "flags": [True],
    "maybe": None,
    "kind": "a",
}


def test_a_model_is_what_the_dataclass_says() -> None:
    model = model_of(Outer, SHAPES)
    assert model.model_validate(GOOD, strict=True).model_dump() == GOOD
    assert model.model_json_schema()["description"] == "A whole."
    check = jsonschema.Draft202012Validator(model.model_json_schema())
    assert check.is_valid(GOOD)
    bad: dict[str, Any] = {
        "parts": [{"mean": 1.0, "name": "y"}],
        "by_name": {"q": {"mean": 1.0}},
        "values": ["1"],
        "flags": [1],
        "maybe": "x",
        "kind": "c",
    }
    for name, value in bad.items():
        assert not check.is_valid(GOOD | {name: value}), name


Element = TypeVar("Element", bound=np.generic)
Named = TypeAliasType("Named", NDArray[Element], type_params=(Element,))


def test_an_array_by_another_name_is_an_array() -> None:
    """What NDArray itself is from numpy 2.5 on, which takes Python 3.12."""
    kind = dataclasses.make_dataclass("Kind", [("values", Named[np.float64])])
    good = {"values": [1.0, None]}
    assert model_of(kind, {}).model_validate(good, strict=True).model_dump() == good
    with pytest.raises(ValueError, match="values"):
        model_of(kind, {}).model_validate({"values": "x"}, strict=True)


def test_a_shape_names_what_is_there() -> None:
    with pytest.raises(ValueError, match="Inner has no field colour"):
        model_of(Outer, {Inner: Shape(missing=frozenset({"colour"}))})
    with pytest.raises(ValueError, match="twice"):
        Shape(missing=frozenset({"mean"}), without=frozenset({"mean"}))

    @dataclasses.dataclass
    class Odd:
        when: complex

    with pytest.raises(TypeError, match="no JSON form"):
        model_of(Odd, {})
