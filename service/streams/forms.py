"""How a line is read: as a JSON object, or as values below a header."""

import csv
import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import orjson

from service.column_names import NAMES, check_names
from service.errors import MalformedError
from service.frame_files import check_separator
from service.frame_table import no_value, value_of_text
from service.streams.number_lines import NumberLines, number_lines
from service.strict_json import MAX_DEPTH, SHORT, decode
from simulator.errors import InvalidInputError, escape

__all__ = ["CsvLines", "Form", "JsonLines", "form_like"]

_LINE_END, _OPENING, _CLOSING, _COLON = b"\n{}:"


class Form(Protocol):
    """A way to read lines."""

    def frame_in(self, line: bytes) -> dict[str, Any]:
        """Return the members of a line.

        Raises
        ------
        MalformedError, InvalidInputError
            Where it cannot be read.
        """
        ...

    def frames_in(self, lines: Sequence[bytes]) -> list[dict[str, Any]]:
        """Return the members of many lines, the same as of each by itself.

        Raises
        ------
        MalformedError, InvalidInputError
            Where any of them cannot be read.
        """
        ...

    def numbers_in(self, lines: Sequence[bytes]) -> NumberLines | None:
        """Return the members of many lines that hold numbers alone; None for all others."""
        ...


class JsonLines:
    """Lines that are JSON objects.

    A quick reader reads them; where a name may have come twice, or anything else is out of the
    ordinary, the strict one reads them again, and says what is wrong.
    """

    def frame_in(self, line: bytes) -> dict[str, Any]:
        """See `Form.frame_in`."""
        try:
            frame = orjson.loads(line)
        except orjson.JSONDecodeError:
            frame = _strictly(line)
        else:
            if type(frame) is not dict or not _plain(line, frame):
                frame = _strictly(line)
        if not isinstance(frame, dict):
            raise MalformedError("the line is not a JSON object")
        if len(frame) > SHORT:
            raise MalformedError(f"the line has more than {SHORT} members")
        return frame

    def frames_in(self, lines: Sequence[bytes]) -> list[dict[str, Any]]:
        """See `Form.frames_in`."""
        return _all_at_once(lines) or [self.frame_in(line) for line in lines]

    def numbers_in(self, lines: Sequence[bytes]) -> NumberLines | None:
        """See `Form.numbers_in`."""
        return number_lines(lines)


def _all_at_once(lines: Sequence[bytes]) -> list[dict[str, Any]] | None:
    """Read lines as one list; None where that might not be what each is by itself.

    Every line begins and ends with the only braces that it has, and there are as many objects as
    braces: no object goes on in another line, and none lies between two.
    """
    n, body = len(lines), b"\n".join(lines)
    # what occurs often is counted by numpy in a fifth of the time
    text = np.frombuffer(body, dtype=np.uint8)
    ends = np.flatnonzero(text == _LINE_END)
    if not (
        body.startswith(b"{")
        and body.endswith(b"}")
        and np.count_nonzero(text == _OPENING) == n
        and ends.size == n - 1
        and bool((text[ends - 1] == _CLOSING).all())
        and bool((text[ends + 1] == _OPENING).all())
        and b"[" not in body
    ):
        return None
    try:
        frames: list[dict[str, Any]] = orjson.loads(b"[%b]" % body.replace(b"\n", b","))
    except orjson.JSONDecodeError:
        return None
    # a name that came twice, or a text with a colon, has one too many; frame_in tells which
    if len(frames) != n or set(map(type, frames)) != {dict}:
        return None
    if np.count_nonzero(text == _COLON) != sum(map(len, frames)) or max(map(len, frames)) > SHORT:
        return None
    return frames


def _plain(line: bytes, frame: dict[str, Any]) -> bool:
    """Tell whether every colon is accounted for: a name that came twice has one too many."""
    if line.count(b"[") + line.count(b"{") > MAX_DEPTH:
        return False
    colons = line.count(b":")
    return colons == len(frame) or (b"\\" not in line and colons == _colons(frame))


def _colons(value: Any) -> int:
    if isinstance(value, str):
        return value.count(":")
    if isinstance(value, dict):
        return sum(1 + name.count(":") + _colons(member) for name, member in value.items())
    return sum(map(_colons, value)) if isinstance(value, list) else 0


def _strictly(line: bytes) -> Any:
    value = decode(line)
    _refuse_infinite(value, "")
    return value


def _refuse_infinite(value: Any, pointer: str) -> None:
    """Refuse what JSON does not have: it could not be passed through."""
    if isinstance(value, float) and not math.isfinite(value):
        raise InvalidInputError.at(pointer, "must be a finite number")
    if isinstance(value, dict):
        for name, member in value.items():
            _refuse_infinite(member, f"{pointer}/{escape(name)}")
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            _refuse_infinite(entry, f"{pointer}/{index}")


class CsvLines:
    """Lines of comma-separated values below a header.

    Parameters
    ----------
    header : bytes
        The line with the names.

    Raises
    ------
    InvalidInputError, MalformedError
        As for files (`service.frame_files`).
    """

    def __init__(self, header: bytes) -> None:
        self._names = [name.strip() for name in _fields(header)]
        check_separator(self._names)
        check_names([name for name in self._names if name != "sequence"])

    def frame_in(self, line: bytes) -> dict[str, Any]:
        """See `Form.frame_in`."""
        cells = _fields(line)
        if len(cells) != len(self._names):
            message = f"{len(cells)} fields where the header has {len(self._names)}"
            raise MalformedError(message)
        frame: dict[str, Any] = {}
        for name, cell in zip(self._names, cells, strict=True):
            value = value_of_text(name, cell)
            if value is None and name in NAMES:
                raise InvalidInputError.at(f"/{name}", no_value(name, cell))
            if name == "sequence" and isinstance(value, float) and value.is_integer():
                value = int(value)
            frame[name] = cell if value is None else value
        return frame

    def frames_in(self, lines: Sequence[bytes]) -> list[dict[str, Any]]:
        """See `Form.frames_in`."""
        return [self.frame_in(line) for line in lines]

    def numbers_in(self, lines: Sequence[bytes]) -> None:
        """See `Form.numbers_in`."""


def _fields(line: bytes) -> list[str]:
    try:
        return next(csv.reader([line.decode("utf-8").rstrip("\r\n")], strict=True), [])
    except (UnicodeDecodeError, csv.Error) as error:
        raise MalformedError(f"the line cannot be read: {error}") from None


def form_like(first: bytes) -> tuple[Form, bool]:
    """Choose how to read a stream by its first line, and say whether that line is a frame."""
    if first.lstrip().startswith(b"{"):
        return JsonLines(), True
    return CsvLines(first), False
