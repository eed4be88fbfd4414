"""Lines that are alike to the byte but for the numbers in them: the way of nearly all streams.

What lies between the numbers of the first line is looked for in all of them at once, and the
numbers are read as one list. What is not exactly so is left to `service.streams.forms`, which
reads each line; what is read is the same either way.
"""

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import orjson

__all__ = ["NumberLines", "number_lines"]

_NUMBER = re.compile(rb"(?<=:)(\s*)(-?[0-9][0-9.eE+-]*)")
_DIGITS = b"0123456789+-.eE"
# no JSON text has any of them
_MARKS = [bytes([code]) for code in range(1, 32) if code not in b"\t\n\r"]


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


class _Between(NamedTuple):
    """What lies before the first number of a line, between two, and after the last."""

    first: bytes
    between: list[bytes]
    last: bytes


def number_lines(lines: Sequence[bytes]) -> NumberLines | None:
    """Read lines whose members are numbers; None where any of them is not like the first.

    What lies between numbers is replaced by marks that occur nowhere else, each kind by its own.
    If then nothing is left of all lines but numbers and the marks in their order, every line is
    the first one with other numbers.
    """
    found = _first(lines[0])
    if found is None:
        return None
    names, (first, between, last) = found
    text = b"\n".join(lines)
    marks = _MARKS[: len(names)]
    end = len(text) - len(last)
    if not (text.startswith(first) and text.endswith(last)) or any(m in text for m in marks):
        return None
    text = text[len(first) : end]
    for mark, fixed in zip(marks, [last + b"\n" + first, *between], strict=True):
        text = text.replace(fixed, mark)
    one_line = b"".join([*marks[1:], marks[0]])
    if text.translate(None, _DIGITS) != (one_line * len(lines))[:-1]:
        return None
    try:
        # no number, or what is none, between two marks is no JSON
        values = orjson.loads(b"[%b]" % text.translate(_to_commas(marks)))
    except orjson.JSONDecodeError:
        return None
    return NumberLines(names, values)


def _first(line: bytes) -> tuple[tuple[str, ...], _Between] | None:
    """Return the names of a line of numbers, and what lies between these."""
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
    if not fixed or len(fixed) != len(members) or len(fixed) > len(_MARKS):
        return None
    return tuple(members), _Between(fixed[0], fixed[1:], parts[-1])


def _to_commas(marks: Sequence[bytes]) -> bytes:
    every = b"".join(marks)
    return bytes.maketrans(every, b"," * len(every))
