"""Frozen, strictly validated types, and errors that name the field by its JSON pointer."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, TypeVar

import pydantic

from simulator.errors import InvalidInputError, Problem, escape

__all__ = ["NonNegative", "Number", "Positive", "Validated", "is_number", "parse", "problems_of"]

T = TypeVar("T", bound="Validated")

# products of any six of them are numbers, too; no unit of anything needs more
_LARGEST = 1e50
_ALIKE = 0.8  # difflib's ratio: one letter in five


def is_number(value: float) -> bool:
    """Tell whether a value is zero or of a size that can be computed with."""
    return value == 0 or 1 / _LARGEST <= abs(value) <= _LARGEST


def _of_size(value: float) -> float:
    if not is_number(value):
        raise ValueError(
            f"must lie between {1 / _LARGEST:g} and {_LARGEST:g} in magnitude, is {value:g}; state "
            "it in another unit"
        )
    return value


# pydantic's words are those of Python where a client writes JSON
_WORDS = {
    "dict_type": "Input should be a JSON object",
    "model_type": "Input should be a JSON object",
    "model_attributes_type": "Input should be a JSON object",
    "tuple_type": "Input should be a valid list",
}
_SIZE = pydantic.AfterValidator(_of_size)


def _between(low: float) -> pydantic.WithJsonSchema:
    return pydantic.WithJsonSchema({"type": "number", "minimum": low, "maximum": _LARGEST})


Number = Annotated[float, _SIZE, _between(-_LARGEST)]
Positive = Annotated[float, pydantic.Field(gt=0), _SIZE, _between(1 / _LARGEST)]
NonNegative = Annotated[float, pydantic.Field(ge=0), _SIZE, _between(0.0)]


class Validated(pydantic.BaseModel):
    """Base of the scene language: immutable, no coercion, no unknown fields, nothing non-finite."""

    model_config = pydantic.ConfigDict(
        frozen=True,
        strict=True,
        extra="forbid",
        allow_inf_nan=False,
        revalidate_instances="never",
        # most types are parts of others, or of no use to a process
        defer_build=True,
    )


def _pointer(location: Sequence[int | str], data: object, missing: bool) -> str:
    """Turn a pydantic location into a JSON pointer, without the names of union branches.

    A part is kept if it leads into ``data``, and the last one if it names what is missing.
    """
    parts: list[str] = []
    here: Any = data
    for position, part in enumerate(location):
        if isinstance(here, Mapping):
            leads = part in here
        else:
            leads = isinstance(here, list | tuple) and isinstance(part, int) and part < len(here)
        if leads:
            here = here[part]
        elif not (missing and position == len(location) - 1):
            continue
        parts.append(escape(str(part)))
    return "".join("/" + part for part in parts)


def _names(model: type[pydantic.BaseModel]) -> set[str]:
    """Return the members of all validated types."""
    return set(model.model_fields).union(*map(_names, model.__subclasses__()))


def _hint(name: str) -> str:
    """Return which member may be meant by one that there is not, if any is alike."""
    from difflib import get_close_matches  # seldom needed

    alike = get_close_matches(name.lower(), sorted(_names(Validated)), n=1, cutoff=_ALIKE)
    return f": did you mean {alike[0]}?" if alike and alike[0] != name else ""


def problems_of(error: pydantic.ValidationError, data: object) -> tuple[Problem, ...]:
    """List what pydantic found, one `Problem` for each field and message.

    Parameters
    ----------
    error : pydantic.ValidationError
        The error.
    data : object
        The input as plain JSON data, by which union branches are told from fields.
    """
    found: dict[Problem, None] = {}
    for item in error.errors(include_url=False):
        if item["type"] == "too_short" and len(item["input"]) >= item["ctx"]["min_length"]:
            continue  # valid items alone were counted, and what is wrong with others is said
        pointer = _pointer(item["loc"], data, item["type"] == "missing")
        if item["type"].startswith("union_tag"):
            pointer += "/" + str(item["ctx"]["discriminator"]).strip("'")
        # pydantic puts the class of a raised ValueError before its text
        message = _WORDS.get(item["type"], item["msg"]).removeprefix("Value error, ")
        if item["type"] == "extra_forbidden":
            message += _hint(str(item["loc"][-1]))
        found[Problem(pointer, message.replace("Tuple should", "List should"))] = None
    return tuple(found)


def parse(model: type[T], data: Any) -> T:
    """Validate plain JSON data.

    Parameters
    ----------
    model : type
        A subclass of `Validated`.
    data : Any
        Decoded JSON (dict, list, str, int, float, bool, None).

    Raises
    ------
    InvalidInputError
        With a pointer for each offending field.
    """
    try:
        return model.model_validate(data)
    except pydantic.ValidationError as error:
        raise InvalidInputError(*problems_of(error, data)) from None
