"""Frames from files and to files: ``.csv``, ``.ndjson``, ``.json``, with the contract's columns."""

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from service.errors import MalformedError
from service.strict_json import check_bulk, decode
from simulator.errors import InvalidInputError, escape
from simulator.frames import FrameColumns
from simulator.validated import parse

__all__ = ["SUFFIXES", "read_frames", "write_frames"]

Columns = dict[str, list[Any]]

_BOOLEANS = {"true": True, "false": False}
_NAMES = tuple(FrameColumns.model_fields)


def read_frames(path: Path) -> FrameColumns:
    """Read frames.

    Parameters
    ----------
    path : Path
        ``.json``: an object of columns; ``.ndjson``: one frame a line; ``.csv``: a header with
        the names of the columns and one frame a row.

    Returns
    -------
    FrameColumns
        The columns.

    Raises
    ------
    InvalidInputError
        A pointer ``/column`` or ``/column/index`` for each offending field, the line in the text.
    MalformedError
        Where the file cannot be read as what its name says, or its name says nothing.
    OSError
        Where it cannot be opened.
    """
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise MalformedError(f"frames are read from {', '.join(SUFFIXES)}, not '{path.suffix}'")
    columns = read(path.read_bytes())
    check_bulk(columns)
    return parse(FrameColumns, columns)


def _from_json(raw: bytes) -> Any:
    return decode(raw)


def _from_ndjson(raw: bytes) -> Columns:
    columns: Columns = {}
    for number, line in enumerate(raw.splitlines(), start=1):
        if not line.strip():
            continue
        try:
            frame = decode(line)
        except (MalformedError, InvalidInputError) as error:
            raise MalformedError(f"line {number}: {error}") from None
        if not isinstance(frame, dict):
            raise MalformedError(f"line {number} is not a JSON object")
        if not columns:
            columns = {name: [] for name in frame}
        if frame.keys() != columns.keys():
            name = min(frame.keys() ^ columns.keys())
            message = f"line {number}: every line must have the members of the first one"
            raise InvalidInputError.at(f"/{escape(name)}", message)
        for name, value in frame.items():
            if isinstance(value, list | dict):
                message = f"line {number}: must be one value"
                raise InvalidInputError.at(f"/{escape(name)}", message)
            columns[name].append(value)
    if not columns:
        raise MalformedError("the file holds no frame")
    return columns


def _from_csv(raw: bytes) -> Columns:
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MalformedError(f"the file is not UTF-8 at byte {error.start}") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise MalformedError(f"line {reader.line_num}: {error}") from None
    if not rows:
        raise MalformedError("the file is empty; its first line must name the columns")
    header = [name.strip() for name in rows[0][1]]
    for name in header:
        if name not in _NAMES:
            wanted = ", ".join(_NAMES)
            raise InvalidInputError.at(f"/{escape(name)}", f"is not a column; they are {wanted}")
        if header.count(name) > 1:
            raise InvalidInputError.at(f"/{name}", "the column is repeated")
    for line, row in rows[1:]:
        if len(row) != len(header):
            message = f"line {line} has {len(row)} fields where the header has {len(header)}"
            raise MalformedError(message)
    lines = [line for line, _ in rows[1:]]
    cells = zip(*(row for _, row in rows[1:]), strict=True) if lines else [()] * len(header)
    return {name: _column(name, texts, lines) for name, texts in zip(header, cells, strict=True)}


def _column(name: str, texts: Sequence[str], lines: Sequence[int]) -> list[Any]:
    convert = _boolean if name == "object_present" else _number
    values: list[Any] = []
    for index, text in enumerate(texts):
        value = convert(text)
        if value is None:
            wanted = "true or false" if name == "object_present" else "a finite number"
            message = f"line {lines[index]}: must be {wanted}, is {text.strip()[:40]!r}"
            raise InvalidInputError.at(f"/{name}/{index}", message)
        values.append(value)
    return values


def _boolean(text: str) -> bool | None:
    return _BOOLEANS.get(text.strip().lower())


def _number(text: str) -> float | None:
    """Return a finite number; None for what Python alone takes for one (1_000, other digits)."""
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and text.isascii() and "_" not in text else None


def write_frames(path: Path, columns: Mapping[str, Sequence[float | bool]]) -> None:
    """Write frames so that `read_frames` gives them back to the last bit.

    Parameters
    ----------
    path : Path
        Its suffix says in which form.
    columns : mapping
        Columns of equal length, such as `Frames.to_columns` gives.

    Raises
    ------
    MalformedError
        Where the suffix says nothing.
    OSError
        Where the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise MalformedError(f"frames are written to {', '.join(SUFFIXES)}, not '{path.suffix}'")
    if suffix == ".json":
        text = json.dumps(columns, allow_nan=False) + "\n"
    else:
        rows = zip(*columns.values(), strict=True)
        if suffix == ".ndjson":
            frames = (dict(zip(columns, row, strict=True)) for row in rows)
            text = "".join(json.dumps(frame, allow_nan=False) + "\n" for frame in frames)
        else:
            lines = (",".join(json.dumps(value, allow_nan=False) for value in row) for row in rows)
            text = "\n".join([",".join(columns), *lines]) + "\n"
    path.write_text(text, encoding="utf-8")


_READERS: Mapping[str, Callable[[bytes], Any]] = {
    ".csv": _from_csv,
    ".ndjson": _from_ndjson,
    ".json": _from_json,
}
SUFFIXES = tuple(_READERS)
