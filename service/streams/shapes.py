"""Lines with the same members, checked once for all of them."""

import functools
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from inference.tracking.track import step
from inference.tracking.tracker import Tracker
from service.column_names import NAMES, check_names
from simulator.errors import InvalidInputError
from simulator.frames import FrameColumns, Frames, frames_from_columns
from simulator.known_ranges import MAY_BE_NULL
from simulator.validated import parse

__all__ = [
    "ANSWERED",
    "Shape",
    "frames_of",
    "of_one_frame",
    "one_frame",
    "passes",
    "shape_of",
    "tells",
]

ANSWERED = frozenset(
    {
        "sequence", "time_s", "status", "range_m", "sd_m", "sd_parts_m", "hypotheses", "present",
        "outlier", "rate_m_s", "misfit", "latency_s", "error", "gap", "dropped",
        "calibration", "assumptions", "reason",
    }
)  # fmt: skip
"""Members of answers: what comes under these names is not passed through."""

_NUMBERS = frozenset({float, int})
_FLAGS = frozenset({bool})
_NULLABLE: frozenset[type] = frozenset({float, int, type(None)})
Kinds = frozenset[type]


class Shape(NamedTuple):
    """What lines of the same members have in common.

    Attributes
    ----------
    columns : tuple of str
        Those that are a frame's.
    passed : tuple of str
        Those that are passed through.
    values : callable
        Returns the frame's values, in the order of ``columns``.
    kinds : tuple of frozenset of type
        Of which type each of them is.
    problem : InvalidInputError or None
        What is wrong with the members of all such lines.
    """

    columns: tuple[str, ...]
    passed: tuple[str, ...]
    values: Callable[[Mapping[str, Any]], tuple[Any, ...]]
    kinds: tuple[Kinds, ...]
    problem: InvalidInputError | None

    def sound(self, values: tuple[Any, ...]) -> bool:
        """Tell whether values need no closer look."""
        for value in values:
            if type(value) is not float:
                break
        else:
            return _FLAGS not in self.kinds
        return all(type(v) in kinds for v, kinds in zip(values, self.kinds, strict=True))


def _kinds_of(column: str) -> Kinds:
    """Return the types that values of a column have."""
    if column == "object_present":
        return _FLAGS
    return _NULLABLE if column in MAY_BE_NULL else _NUMBERS


def passes(name: str) -> bool:
    """Tell whether a member is passed through."""
    return name not in ANSWERED and name not in NAMES


def tells(name: str) -> bool:
    """Tell whether the answer to a line depends on a member, beside the number that it states."""
    return name in NAMES or passes(name)


@functools.lru_cache(maxsize=256)
def shape_of(model: Tracker, names: tuple[str, ...]) -> Shape:
    """Return what lines with these members have in common.

    Parameters
    ----------
    model : Tracker
        Which follows the stream.
    names : tuple of str
        Of all members.
    """
    columns = tuple(name for name in names if name in NAMES)
    passed = tuple(filter(passes, names))
    kinds = tuple(map(_kinds_of, columns))
    problem = None
    try:
        check_names([name for name in names if name not in ANSWERED or name in NAMES])
        # what may be null tells nothing in the example: only its values say what is wrong with it
        examples: dict[Kinds, Any] = {_FLAGS: True, _NUMBERS: 1.0, _NULLABLE: None}
        example = {name: [examples[kind]] for name, kind in zip(columns, kinds, strict=True)}
        step(model, model.first, frames_from_columns(model.sensor, example))
    except InvalidInputError as error:
        problem = of_one_frame(error)
    pick: Callable[[Mapping[str, Any]], Any] = itemgetter(*columns) if columns else tuple
    if len(columns) == 1:
        (only,) = columns
        return Shape(columns, passed, lambda frame: (frame[only],), kinds, problem)
    return Shape(columns, passed, pick, kinds, problem)


def frames_of(model: Tracker, shape: Shape, columns: Sequence[Sequence[Any]]) -> Frames:
    """Return the frames of lines of one shape, whose values are sound.

    Parameters
    ----------
    model : Tracker
        Which follows the stream.
    shape : Shape
        Of the lines.
    columns : sequence of sequence
        The values of all lines, in the order of the shape's columns.

    Raises
    ------
    InvalidInputError
        Where a value breaks a rule of its own.
    """
    arrays = {
        name: np.array(column, dtype=np.bool_ if kinds is _FLAGS else np.float64)
        for name, column, kinds in zip(shape.columns, columns, shape.kinds, strict=True)
    }
    return frames_from_columns(model.sensor, arrays)


def one_frame(model: Tracker, frame: Mapping[str, Any], columns: tuple[str, ...]) -> Frames:
    """Return the frame of one line, checked as a request's would be.

    Raises
    ------
    InvalidInputError
        With the pointer to the member that is wrong.
    """
    try:
        given = parse(FrameColumns, {name: [frame[name]] for name in columns})
        return frames_from_columns(model.sensor, given)
    except InvalidInputError as error:
        raise of_one_frame(error) from None


def of_one_frame(error: InvalidInputError) -> InvalidInputError:
    """Let pointers into columns of one entry point into the line."""
    first = error.problems[0]
    pointer = first.pointer.removeprefix("/frames").removesuffix("/0")
    return InvalidInputError.at(pointer, first.message)
