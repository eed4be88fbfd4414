"""Frames as they stand in a file: good rows, and rows that cannot be read."""

import dataclasses
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from service.column_names import NAMES, check_names, check_readings, ignored_names
from service.errors import MalformedError
from service.strict_json import check_bulk
from simulator.errors import HybridTofError, InvalidInputError, escape
from simulator.frames import FrameColumns
from simulator.known_ranges import MAY_BE_NULL
from simulator.validated import parse

__all__ = ["BadRow", "FrameTable", "Row", "no_value", "table_of", "value_of_json", "value_of_text"]


@dataclasses.dataclass(frozen=True, slots=True)
class BadRow:
    """A row that holds no frame, and why.

    Attributes
    ----------
    index : int
        Of the frame, from 0.
    line : int
        In the file, from 1.
    column : str or None
        Where the row is wrong; None where it is wrong as a whole.
    reason : str
        What is wrong.
    """

    index: int
    line: int
    column: str | None
    reason: str

    def __str__(self) -> str:
        return f"line {self.line}: {f'{self.column} ' if self.column else ''}{self.reason}"

    def error(self) -> HybridTofError:
        """Return the error of a reader who takes good rows only."""
        if self.column is None:
            return MalformedError(f"line {self.line} {self.reason}")
        pointer = f"/{escape(self.column)}/{self.index}"
        return InvalidInputError.at(pointer, f"line {self.line}: {self.reason}")


@dataclasses.dataclass(frozen=True, slots=True)
class FrameTable:
    """The frames of one file.

    Attributes
    ----------
    columns : FrameColumns
        Of the good rows; at least one.
    bad : tuple of BadRow
        The others, in their order.
    ignored : tuple of str
        Names of columns that are not the project's, and cannot be meant as such.
    """

    columns: FrameColumns
    bad: tuple[BadRow, ...] = ()
    ignored: tuple[str, ...] = ()

    def all_good(self) -> FrameColumns:
        """Return the columns of a file in which every row and every column is good.

        Raises
        ------
        InvalidInputError, MalformedError
            For the first ignored column, or the first bad row.
        """
        for name in self.ignored:
            wanted = ", ".join(NAMES)
            raise InvalidInputError.at(f"/{escape(name)}", f"is not a column; they are {wanted}")
        for row in self.bad:
            raise row.error()
        return self.columns


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """One row as it was read: ``cells`` in the order of the columns, or what is wrong with it."""

    line: int
    cells: Sequence[Any] = ()
    reason: str = ""
    column: str | None = None


def table_of(
    names: Sequence[str],
    rows: Sequence[Row],
    value_of: Callable[[str, Any], float | bool | None],
) -> FrameTable:
    """Put rows together.

    Parameters
    ----------
    names : sequence of str
        Of the columns.
    rows : sequence of Row
        As they were read.
    value_of : callable
        `value_of_text` or `value_of_json`: gives the value of a cell, by its column's name, or
        None.

    Raises
    ------
    InvalidInputError, MalformedError
        For columns' names (`check_names`, `check_readings`); where no row is good, for the first.
    """
    check_names(names)
    check_readings(names)
    wanted = [(position, name) for position, name in enumerate(names) if name in NAMES]
    columns: dict[str, list[Any]] = {name: [] for _, name in wanted}
    bad: list[BadRow] = []
    for index, row in enumerate(rows):
        wrong = _take(columns, wanted, index, row, value_of)
        if wrong is not None:
            bad.append(wrong)
    if rows and len(bad) == len(rows):
        raise bad[0].error()
    check_bulk(columns)
    return FrameTable(parse(FrameColumns, columns), tuple(bad), tuple(ignored_names(names)))


def _take(
    columns: Mapping[str, list[Any]],
    wanted: Sequence[tuple[int, str]],
    index: int,
    row: Row,
    value_of: Callable[[str, Any], float | bool | None],
) -> BadRow | None:
    """Append a row's values to the columns, all of them or none."""
    if row.reason:
        return BadRow(index, row.line, row.column, row.reason)
    values: list[Any] = []
    for position, name in wanted:
        cell = row.cells[position]
        value = value_of(name, cell)
        if value is None:
            return BadRow(index, row.line, name, no_value(name, cell))
        if name == "gain" and value <= 0:
            return BadRow(index, row.line, name, f"must be above 0, is {value:g}")
        values.append(None if math.isnan(value) else value)
    for (_, name), value in zip(wanted, values, strict=True):
        columns[name].append(value)
    return None


def no_value(name: str, cell: object) -> str:
    """Return what is wrong with a cell that has no value."""
    must = _TRUE_OR_FALSE if name == "object_present" else "a finite number"
    said = cell.strip() if isinstance(cell, str) else cell
    hint = _comma(said) if isinstance(said, str) else ""
    return f"must be {must}, is {repr(said)[:42]}{hint}"


def _comma(said: str) -> str:
    """Return what to do about a comma in a number; nothing of any other cell."""
    if re.fullmatch(r"[-+]?[1-9]\d{0,2},\d{3}", said):
        return ": write no separators of thousands, and a point for a decimal comma"
    if re.fullmatch(r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?", said):
        return ": write no separators of thousands"
    if said.count(",") != 1:
        return ""
    try:
        float(said.replace(",", "."))
    except ValueError:
        return ""
    return ": write a point for the decimal comma"


def value_of_json(name: str, value: Any) -> float | bool | None:
    """Return a JSON value that a column may hold, nan for null in its place; None for any other."""
    if name == "object_present":
        return value if isinstance(value, bool) else None
    if value is None and name in MAY_BE_NULL:
        return math.nan
    if type(value) not in (int, float):
        return None
    return value if math.isfinite(value) else None


_TRUE_OR_FALSE = "true or false (in a CSV also 1 or 0)"
_TRUTHS = {"true": True, "false": False, "1": True, "0": False}


def value_of_text(name: str, text: str) -> float | bool | None:
    """Return the value of a CSV field; None for what Python alone takes for a number (1_000)."""
    if name == "object_present":
        return _TRUTHS.get(text.strip().lower())
    if name in MAY_BE_NULL and text.strip().lower() in ("", "nan", "null"):
        return math.nan
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and text.isascii() and "_" not in text else None
