"""Many lines of one shape, read and checked all at once: the way of nearly all batches.

What is out of the ordinary in any of them is left to `service.streams.taking`, which looks at each
line and says what is wrong with it. The answers are the same either way.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from inference.tracking.tracker import Tracker
from service.streams.forms import Form
from service.streams.lines import LARGEST, Line
from service.streams.shapes import frames_of, shape_of
from simulator.errors import HybridTofError
from simulator.frames import Frames

__all__ = ["Together", "together"]

_Read = tuple[tuple[str, ...], Callable[[str], Sequence[Any]]]
_DROPPED = attrgetter("dropped")
_FEW = 4  # fewer are answered as quickly one by one


class Together(NamedTuple):
    """Frames of one shape with numbers one after another.

    Attributes
    ----------
    frames : Frames
        n of them.
    sequences : sequence of int
        Their numbers.
    times : sequence of float
        Their times as they were sent [s].
    passed : list of dict, or None
        What is passed through of each; None where nothing is.
    """

    frames: Frames
    sequences: Sequence[int]
    times: Sequence[float]
    passed: list[dict[str, Any] | None] | None


def together(
    model: Tracker, form: Form, lines: Sequence[Line], where: tuple[int, int, float]
) -> Together | None:
    """Read lines that are good and alike.

    Parameters
    ----------
    model : Tracker
        Which follows the stream.
    form : Form
        How to read them.
    lines : sequence of Line
        What came.
    where : tuple of int, int, float
        The last number that was answered, the one that counts on, and the time of the last frame
        [s], nan before the first.

    Returns
    -------
    Together or None
        None where a closer look at each line is needed.
    """
    raws = [line.raw for line in lines if line.raw is not None]
    if len(lines) < _FEW or len(raws) < len(lines) or any(map(_DROPPED, lines[1:])):
        return None
    read = _alike(form, raws)
    if read is None:
        return None
    names, values_of = read
    shape = shape_of(model, names)
    if shape.problem is not None:
        return None
    last, after, time_s = where
    stated = values_of("sequence") if "sequence" in names else None
    sequences = _numbers(stated, len(lines), last, after)
    columns = {name: values_of(name) for name in shape.columns}
    kinds = dict(zip(shape.columns, shape.kinds, strict=True))
    sound = all(set(map(type, columns[name])) <= kinds[name] for name in columns)
    if sequences is None or not sound:
        return None
    times = columns["time_s"]
    increasing = np.diff(np.array([time_s, *times], dtype=np.float64)) > 0
    if not increasing[1:].all() or not (increasing[0] or np.isnan(time_s)):
        return None
    try:
        found = frames_of(model, shape, list(columns.values()))
    except HybridTofError:
        return None
    passed: list[dict[str, Any] | None] | None = None
    if shape.passed:
        rows = zip(*map(values_of, shape.passed), strict=True)
        passed = [dict(zip(shape.passed, row, strict=True)) for row in rows]
    return Together(found, sequences, times, passed)


def _alike(form: Form, raws: Sequence[bytes]) -> _Read | None:
    """Return the names of members that all lines have, and what gives the values of each."""
    numbers = form.numbers_in(raws)
    if numbers is not None:
        return numbers.names, numbers.column
    try:
        frames = form.frames_in(raws)
    except HybridTofError:
        return None
    names = tuple(frames[0])
    if set(map(tuple, frames)) != {names}:
        return None
    return names, lambda name: [frame[name] for frame in frames]


def _numbers(
    stated: Sequence[Any] | None, count: int, last: int, after: int
) -> Sequence[int] | None:
    """Return the numbers of lines, where they are one after another."""
    if stated is None:
        return range(after, after + count)
    first = stated[0]
    if set(map(type, stated)) != {int} or first < 0 or not last < first <= LARGEST - count:
        return None
    counted = list(range(first, first + count))
    return counted if stated == counted else None
