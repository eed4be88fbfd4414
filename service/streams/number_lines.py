"""Lines that are alike to the byte but for the numbers in them: the way of nearly all streams.

What lies between the numbers of the first line is looked for in all of them, and the numbers are
read as one list. What is not exactly so is left to `service.streams.forms`, which reads each line;
what is read is the same either way.
"""

import re
from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
import orjson
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["NumberLines", "number_lines"]

_NUMBER = re.compile(rb"(?<=:)(\s*)(-?[0-9][0-9.eE+-]*)")
_IN_NUMBERS = np.array([code in b"0123456789+-.eE" for code in range(256)])
_BEGIN, _END, _COMMA = b"[],"


class NumberLines(NamedTuple):
    """Numbers of n lines.

    Attributes
    ----------
    names : tuple of str
        The k members of each line, in their order.
    values : list of int or float
        n times k of them, line by line.
    """

    names: tuple[str, ...]
    values: list[Any]

    def column(self, name: str) -> list[Any]:
        """Return the values of a member."""
        return self.values[self.names.index(name) :: len(self.names)]


def number_lines(lines: Sequence[bytes]) -> NumberLines | None:
    """Read lines whose members are numbers; None where any of them is not like the first."""
    found = _first(lines[0])
    if found is None:
        return None
    names, fixed = found
    text = b"\n".join([*lines, b""])
    fixed[-1] += b"\n"
    # each number, with a comma, takes less room than with what comes after it
    numbers = np.full(len(text) + 1, _BEGIN, dtype=np.uint8)
    length = _pick(
        np.frombuffer(text, dtype=np.uint8),
        np.frombuffer(b"".join(fixed), dtype=np.uint8),
        np.array([0, *accumulate(map(len, fixed))], dtype=np.uint64),
        len(lines),
        numbers[1:],
    )
    if length < 0:
        return None
    numbers[length] = _END
    try:
        # what is no number, or none at all, is no JSON
        return NumberLines(names, orjson.loads(numbers[: length + 1].data))
    except orjson.JSONDecodeError:
        return None


@compiled
def _pick(
    text: NDArray[np.uint8],
    fixed: NDArray[np.uint8],
    parts: NDArray[np.uint64],
    n: int,
    numbers: NDArray[np.uint8],
) -> int:
    """Write what stands in n lines between what they have in common.

    Parameters
    ----------
    text : ndarray of uint8
        The lines, each with its end.
    fixed : ndarray of uint8
        What all lines have in common.
    parts : ndarray of uint64, shape (k + 2,)
        Where each of its k + 1 parts begins, and where the last ends.
    n : int
        How many lines.
    numbers : ndarray of uint8
        Room for the k numbers of all lines, each with a comma.

    Returns
    -------
    int
        How many bytes they have; -1 where anything else differs between the lines.
    """
    # places without a sign: of one with a sign a kernel asks whether it counts from the end
    one, at, to, size = np.uint64(1), np.uint64(0), np.uint64(0), np.uint64(len(text))
    k = len(parts) - 2
    for _ in range(n):
        for part in range(k + 1):
            here, end = parts[part], parts[part + 1]
            if at + (end - here) > size:
                return -1
            while here < end:
                if text[at] != fixed[here]:
                    return -1
                at += one
                here += one
            if part < k:
                while at < size and _IN_NUMBERS[text[at]]:
                    numbers[to] = text[at]
                    to += one
                    at += one
                numbers[to] = _COMMA
                to += one
    return int(np.int64(to)) if at == size else -1


def _first(line: bytes) -> tuple[tuple[str, ...], list[bytes]] | None:
    """Return the names of a line of numbers, and what lies before, between and after these."""
    try:
        members = orjson.loads(line)
    except orjson.JSONDecodeError:
        return None
    if type(members) is not dict or not set(map(type, members.values())) <= {int, float}:
        return None
    # text, space, number, text, space, number, ..., text
    parts = _NUMBER.split(line)
    fixed = [text + space for text, space in zip(parts[:-1:3], parts[1::3], strict=True)]
    # a name that came twice, or one that looks like a number
    if not fixed or len(fixed) != len(members):
        return None
    return tuple(members), [*fixed, parts[-1]]
