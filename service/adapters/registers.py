"""Dumps of registers: bytes, hexadecimal text or CSV, as integers by the register's name."""

import csv
import dataclasses
import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from service.errors import MalformedError
from simulator.errors import InvalidInputError, escape

__all__ = ["FORMS", "MOST_FRAMES", "Field", "Layout", "Registers", "registers_of"]

Integers = NDArray[np.int64]
FORMS = (".bin", ".hex", ".csv")
MOST_FRAMES = 2_000_000  # as many as a column holds


@dataclasses.dataclass(frozen=True, slots=True)
class Field:
    """One number among the bytes of a frame.

    Attributes
    ----------
    name : str
        Of the register, and of its column in a CSV.
    at : int
        Its first byte within a frame.
    size : int
        Bytes of the word that holds it.
    low, bits : int
        Its lowest bit in the word, and how many it has; 0 bits is all of them.
    signed : bool
        Two's complement.
    needed : bool
        Whether a CSV must have it.
    """

    name: str
    at: int
    size: int
    low: int = 0
    bits: int = 0
    signed: bool = False
    needed: bool = False

    @property
    def limits(self) -> tuple[int, int]:
        """Least and greatest value."""
        bits = self.bits or 8 * self.size
        return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if self.signed else (0, (1 << bits) - 1)


@dataclasses.dataclass(frozen=True, slots=True)
class Layout:
    """How the bytes of a frame stand.

    Attributes
    ----------
    width : int
        Bytes of a frame.
    order : "big" or "little"
        Of the bytes of a word.
    fields : tuple of Field
        What is read of them.
    """

    width: int
    order: Literal["big", "little"]
    fields: tuple[Field, ...]


@dataclasses.dataclass(frozen=True, eq=False)
class Registers:
    """Registers of n frames.

    Attributes
    ----------
    values : mapping of str to ndarray of int, shape (n,)
        By their names.
    time_s : ndarray, shape (n,), optional
        Times that a CSV had [s].
    """

    values: Mapping[str, Integers]
    time_s: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return int(next(iter(self.values.values())).size)

    def __getitem__(self, name: str) -> Integers:
        return self.values[name]

    def present(self, *names: str) -> dict[str, NDArray[np.float64]]:
        """Return those of some registers that the dump has, as columns of numbers."""
        return {name: self.values[name].astype(np.float64) for name in names if name in self.values}

    def select(self, rows: NDArray[np.bool_]) -> "Registers":
        """Return some of the frames."""
        time_s = None if self.time_s is None else self.time_s[rows]
        return Registers({name: column[rows] for name, column in self.values.items()}, time_s)


def registers_of(raw: bytes, form: str, layout: Layout) -> Registers:
    """Read a dump.

    Parameters
    ----------
    raw : bytes
        ``.bin``: the bytes of one frame after another. ``.hex``: one frame a line, bytes as pairs
        of digits, apart or not; what follows a ``#`` is left out. ``.csv``: a header with names of
        registers, and perhaps ``time_s``; integers, decimal or with ``0x``.
    form : str
        One of `FORMS`.
    layout : Layout
        Of a frame.

    Returns
    -------
    Registers
        At least one frame.

    Raises
    ------
    InvalidInputError
        Naming column and frame of a value that no such register holds, or a column.
    MalformedError
        Naming the line, or the length that does not fit.
    """
    if form == ".csv":
        return _of_csv(raw, layout)
    data = raw if form == ".bin" else _of_hex(raw, layout.width)
    if not data:
        raise MalformedError(f"the dump holds no frame: one has {layout.width} bytes")
    if len(data) % layout.width:
        raise MalformedError(
            f"{len(data)} bytes are no whole number of frames of {layout.width} bytes"
        )
    if len(data) // layout.width > MOST_FRAMES:
        raise MalformedError(f"more than {MOST_FRAMES} frames")
    table = np.frombuffer(data, dtype=np.uint8).reshape(-1, layout.width).astype(np.int64)
    return Registers({field.name: _field(table, field, layout.order) for field in layout.fields})


def _field(table: Integers, field: Field, order: str) -> Integers:
    word = np.zeros(len(table), dtype=np.int64)
    columns = range(field.at, field.at + field.size)
    for column in columns if order == "big" else reversed(columns):
        word = (word << 8) | table[:, column]
    bits = field.bits or 8 * field.size
    value = (word >> field.low) & ((1 << bits) - 1)
    if field.signed:
        value -= (value >> (bits - 1)) << bits
    return value


def _text(raw: bytes) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MalformedError(f"the dump is not UTF-8 at byte {error.start}") from None


def _of_hex(raw: bytes, width: int) -> bytes:
    frames = []
    for number, line in enumerate(_text(raw).splitlines(), start=1):
        digits = re.sub(r"0x|[\s,:;]", "", line.split("#")[0], flags=re.IGNORECASE)
        if not digits:
            continue
        try:
            frame = bytes.fromhex(digits)
        except ValueError:
            raise MalformedError(f"line {number}: must be pairs of hexadecimal digits") from None
        if len(frame) != width:
            raise MalformedError(f"line {number}: has {len(frame)} bytes where a frame has {width}")
        frames.append(frame)
    return b"".join(frames)


def _of_csv(raw: bytes, layout: Layout) -> Registers:
    reader = csv.reader(io.StringIO(_text(raw), newline=""), strict=True)
    try:
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise MalformedError(f"line {reader.line_num}: {error}") from None
    if len(rows) < 2:
        raise MalformedError("the dump holds no frame: a header of names, then one frame a line")
    if len(rows) - 1 > MOST_FRAMES:
        raise MalformedError(f"more than {MOST_FRAMES} frames")
    header = [name.strip() for name in rows[0][1]]
    fields = {field.name: field for field in layout.fields}
    _check_header(header, fields)
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise MalformedError(f"line {line}: has {len(row)} fields, the header {len(header)}")
    values: dict[str, Integers] = {}
    time_s = None
    for place, name in enumerate(header):
        cells = [(line, row[place].strip()) for line, row in rows[1:]]
        if name == "time_s":
            time_s = np.array([_time(line, cell) for line, cell in cells])
        else:
            values[name] = np.array([_integer(line, c, fields[name]) for line, c in cells])
    return Registers(values, time_s)


def _check_header(header: Sequence[str], fields: Mapping[str, Field]) -> None:
    known = ", ".join((*fields, "time_s"))
    for name in header:
        if name not in fields and name != "time_s":
            message = f"is no register of this sensor; they are {known}"
            raise InvalidInputError.at(f"/{escape(name)}", message)
        if header.count(name) > 1:
            raise InvalidInputError.at(f"/{escape(name)}", "the column is repeated")
    for name, field in fields.items():
        if field.needed and name not in header:
            raise InvalidInputError.at(f"/{name}", "is missing")


def _integer(line: int, cell: str, field: Field) -> int:
    low, high = field.limits
    written = re.fullmatch(r"[-+]?(\d+|0[xX][0-9a-fA-F]+)", cell, re.ASCII)
    value = int(cell, 16 if "x" in cell.lower() else 10) if written and len(cell) < 20 else None
    if value is None or not low <= value <= high:
        message = f"line {line}: must be an integer from {low} to {high}, is {cell[:42]!r}"
        raise InvalidInputError.at(f"/{field.name}", message)
    return value


def _time(line: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        message = f"line {line}: must be a finite number, is {cell[:42]!r}"
        raise InvalidInputError.at("/time_s", message)
    return value
