"""The shape of a dataclass in JSON: derived, so that nothing is written twice.

A field is a member of the same name; an array or a tuple is a list, a number that may be nan is a
number or null. What a dataclass does not say stands in a `Shape`: which of its numbers may be
missing, which texts there are, what is not sent.
"""

import dataclasses
import types
import typing
from collections.abc import Mapping
from typing import Any

import numpy as np
import pydantic

__all__ = ["Shape", "model_of"]


@dataclasses.dataclass(frozen=True)
class Shape:
    """What a dataclass does not say of its JSON.

    Attributes
    ----------
    missing : frozenset of str
        Numbers that may be nan, and null in JSON.
    without : frozenset of str
        Fields that are not sent.
    types : mapping
        Types of members that are not those of the fields.
    """

    missing: frozenset[str] = frozenset()
    without: frozenset[str] = frozenset()
    types: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.missing & self.without or (self.missing | self.without) & self.types.keys():
            raise ValueError("a field is named twice")


def model_of(
    kind: type, shapes: Mapping[type, Shape], extra: Mapping[str, Any] | None = None
) -> type[pydantic.BaseModel]:
    """Derive the model of a dataclass and of all that it is made of.

    Parameters
    ----------
    kind : type
        A dataclass.
    shapes : mapping
        By dataclass, where more must be said than it says itself.
    extra : mapping, optional
        Members besides its fields, with their types.

    Returns
    -------
    type
        Its description is the first paragraph of the dataclass's.

    Raises
    ------
    ValueError
        Where a shape names what is no field of its dataclass.
    TypeError
        For a field of a type that has no JSON form.
    """
    return _model_of(kind, shapes, {}, extra or {})


def _model_of(
    kind: Any,
    shapes: Mapping[type, Shape],
    known: dict[type, type[pydantic.BaseModel]],
    extra: Mapping[str, Any],
) -> type[pydantic.BaseModel]:
    if kind in known:
        return known[kind]
    shape = shapes.get(kind, Shape())
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    unknown = (shape.missing | shape.without | shape.types.keys()) - set(names)
    if unknown:
        raise ValueError(f"{kind.__name__} has no field {', '.join(sorted(unknown))}")
    members: dict[str, Any] = {}
    for name in names:
        if name in shape.without:
            continue
        found = shape.types.get(name) or _json_type(hints[name], shapes, known)
        members[name] = (found | None if name in shape.missing else found, ...)
    members |= {name: (extra_type, ...) for name, extra_type in extra.items()}
    about = (kind.__doc__ or "").split("\n\n")[0].strip()
    model: type[pydantic.BaseModel] = pydantic.create_model(kind.__name__, __doc__=about, **members)
    known[kind] = model
    return model


def _json_type(
    hint: Any, shapes: Mapping[type, Shape], known: dict[type, type[pydantic.BaseModel]]
) -> Any:
    """Return what a field of some type is in JSON."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hasattr(origin, "__value__"):
        # an alias by name, as NDArray is from numpy 2.5 on
        return _json_type(origin.__value__[arguments], shapes, known)
    if dataclasses.is_dataclass(hint):
        return _model_of(hint, shapes, known, {})
    if origin is np.ndarray:
        # elements of an array may always be missing, but for those that cannot be nan
        scalar = typing.get_args(arguments[1])[0]
        kinds = {np.bool_: bool, np.float64: float | None, np.intp: int}
        return types.GenericAlias(list, (kinds[scalar],))
    if origin is list or (origin is tuple and arguments[1:] == (Ellipsis,)):
        return types.GenericAlias(list, (_json_type(arguments[0], shapes, known),))
    if origin is dict:
        return types.GenericAlias(dict, (str, _json_type(arguments[1], shapes, known)))
    if origin in (types.UnionType, typing.Union):
        parts = [
            part if part is type(None) else _json_type(part, shapes, known) for part in arguments
        ]
        return typing.Union[tuple(parts)]  # noqa: UP007  (the parts are computed)
    if hint in (str, int, float, bool) or origin is typing.Literal:
        return hint
    raise TypeError(f"{hint} has no JSON form")
