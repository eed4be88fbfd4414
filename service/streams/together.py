"""Many lines of one shape, read and checked all at once: the way of nearly all batches.

What is out of the ordinary in any of them is left to `service.streams.taking`, which looks at each
line and says what is wrong with it. The answers are the same either way.
"""

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.tracking.tracker import Tracker
from service.streams.digests import Digests, digests_of
from service.streams.forms import Form
from service.streams.lines import LARGEST, Line
from service.streams.shapes import frames_of, shape_of, tells
from simulator.errors import HybridTofError
from simulator.frames import Frames

__all__ = ["Together", "together"]

_Read = tuple[tuple[str, ...], Callable[[str], Sequence[Any]], Callable[[str], set[type]]]
_RAW, _DROPPED = attrgetter("raw"), attrgetter("dropped")
_FEW = 4  # fewer are answered as quickly one by one


class Together(NamedTuple):
    """Frames of one shape with numbers one after another.

    Attributes
    ----------
    frames : Frames
        n of them.
    sequences : sequence of int
        Their numbers.
    times : ndarray, shape (n,)
        Their times [s].
    passed : list of dict, or None
        What is passed through of each; None where nothing is.
    digests : ndarray of uint64, shape (n,)
        Of what they say.
    """

    frames: Frames
    sequences: Sequence[int]
    times: NDArray[np.float64]
    passed: list[dict[str, Any] | None] | None
    digests: Digests


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
    raws = list(map(_RAW, lines))
    if len(lines) < _FEW or not all(raws) or any(map(_DROPPED, lines[1:])):
        return None
    read = _alike(form, raws)
    if read is None:
        return None
    names, values_of, types_of = read
    shape = shape_of(model, names)
    if shape.problem is not None:
        return None
    last, after, time_s = where
    stated = values_of("sequence") if "sequence" in names else None
    sequences = _numbers(stated, len(lines), last, after)
    kinds = zip(shape.columns, shape.kinds, strict=True)
    if sequences is None or not all(types_of(name) <= kind for name, kind in kinds):
        return None
    try:
        found = frames_of(model, shape, list(map(values_of, shape.columns)))
    except HybridTofError:
        return None
    times = found.time_s
    if times is None or not (times[1:] > times[:-1]).all():
        return None
    if not (times[0] > time_s or np.isnan(time_s)):
        return None
    passed: list[dict[str, Any] | None] | None = None
    if shape.passed:
        rows = zip(*map(values_of, shape.passed), strict=True)
        passed = [dict(zip(shape.passed, row, strict=True)) for row in rows]
    digests = digests_of(list(filter(tells, names)), values_of, len(lines))
    return Together(found, sequences, times, passed, digests)


def _alike(form: Form, raws: Sequence[bytes]) -> _Read | None:
    """Return the names of members that all lines have, and what gives values and types of each."""
    numbers = form.numbers_in(raws)
    if numbers is not None:
        return numbers.names, numbers.column, lambda _: {int, float}
    try:
        frames = form.frames_in(raws)
    except HybridTofError:
        return None
    names = tuple(frames[0])
    if set(map(tuple, frames)) != {names}:
        return None

    def values_of(name: str) -> list[Any]:
        return [frame[name] for frame in frames]

    return names, values_of, lambda name: set(map(type, values_of(name)))


def _numbers(
    stated: Sequence[Any] | None, count: int, last: int, after: int
) -> Sequence[int] | None:
    """Return the numbers of lines, where they are one after another."""
    if stated is None:
        return range(after, after + count)
    first = stated[0]
    if set(map(type, stated)) != {int} or first < 0 or not last < first <= LARGEST - count:
        return None
    counted = range(first, first + count)
    return counted if stated == list(counted) else None
