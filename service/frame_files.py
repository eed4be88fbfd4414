"""Frames from files and to files: ``.csv``, ``.ndjson``, ``.json`` (docs/scenes.md, frames)."""

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from service.column_names import check_names, check_readings, ignored_names, meant, with_remedy
from service.errors import MalformedError
from service.frame_table import FrameTable, Row, table_of, value_of_json, value_of_text
from service.strict_json import check_bulk, decode
from simulator.errors import InvalidInputError
from simulator.frames import FrameColumns
from simulator.validated import parse

__all__ = [
    "BYTE_ORDER_MARK",
    "SUFFIXES",
    "check_separator",
    "check_suffix",
    "form_of",
    "no_frame",
    "read_frames",
    "read_table",
    "write_frames",
]

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
"""With which spreadsheets begin a text in UTF-8."""

_SEPARATORS = ";\t| "


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
    check_suffix(path.suffix)
    return read_table(path.read_bytes(), path.suffix).all_good()


def read_table(raw: bytes, suffix: str) -> FrameTable:
    """Read what is good of a file, and say what is not.

    Parameters
    ----------
    raw : bytes
        What stands in it.
    suffix : str
        One of `SUFFIXES`, in any case.

    Returns
    -------
    FrameTable
        Of rows alone some may be bad: an object of columns is good as a whole, or refused.

    Raises
    ------
    InvalidInputError, MalformedError
        As `read_frames`, where no row is good or a column's name must be a mistake.
    """
    check_suffix(suffix)
    return _READERS[suffix.lower()](raw.removeprefix(BYTE_ORDER_MARK))


def form_of(raw: bytes) -> str:
    """Return the suffix that belongs to what stands in a file without a name.

    Parameters
    ----------
    raw : bytes
        Its text.

    Returns
    -------
    str
        ``.csv`` unless it begins with a brace; ``.ndjson`` where the first line is an object whose
        members are no lists.
    """
    text = raw.removeprefix(BYTE_ORDER_MARK).lstrip()
    if not text.startswith(b"{"):
        return ".csv"
    try:
        first = json.loads(text.split(b"\n", 1)[0])
    except ValueError:
        return ".json"
    return ".json" if any(isinstance(value, list) for value in first.values()) else ".ndjson"


def check_suffix(suffix: str, done: str = "read from") -> None:
    """Refuse the suffix of a file that holds no frames.

    Raises
    ------
    MalformedError
        Naming those that do.
    """
    if suffix.lower() not in _READERS:
        raise MalformedError(f"frames are {done} {', '.join(SUFFIXES)}, not '{suffix}'")


def no_frame(suffix: str, header: bool = False) -> MalformedError:
    """Return the error of a file in which nothing is, or nothing below a header."""
    if header or suffix.lower() in (".json", ".ndjson"):
        return MalformedError("the file holds no frame")
    return MalformedError("the file is empty; its first line must name the columns")


def _from_json(raw: bytes) -> FrameTable:
    columns = decode(raw)
    ignored: list[str] = []
    if isinstance(columns, dict):
        check_names(list(columns))
        check_readings(list(columns))
        ignored = ignored_names(list(columns))
        columns = {name: column for name, column in columns.items() if name not in ignored}
    check_bulk(columns)
    try:
        return FrameTable(parse(FrameColumns, columns), (), tuple(ignored))
    except InvalidInputError as error:
        raise with_remedy(error, columns) from None


def _from_ndjson(raw: bytes) -> FrameTable:
    lines = [(n, line) for n, line in enumerate(raw.splitlines(), start=1) if line.strip()]
    if not lines:
        raise no_frame(".ndjson")
    names: list[str] = []
    rows = []
    for number, line in lines:
        try:
            frame = decode(line)
        except (MalformedError, InvalidInputError) as error:
            rows.append(Row(number, reason=f"cannot be read: {error}"))
            continue
        if not isinstance(frame, dict):
            rows.append(Row(number, reason="is not a JSON object"))
            continue
        names = names or list(frame)
        if odd := sorted(frame.keys() ^ set(names)):
            where = "is missing" if odd[0] in names else "is not in the first line"
            rows.append(Row(number, reason=where, column=odd[0]))
        else:
            rows.append(Row(number, [frame[name] for name in names]))
    return table_of(names, rows, value_of_json)


def _from_csv(raw: bytes) -> FrameTable:
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise MalformedError(f"the file is not UTF-8 at byte {error.start}") from None
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        read = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise MalformedError(f"line {reader.line_num}: {error}") from None
    if not read:
        raise no_frame(".csv")
    header = [name.strip() for name in read[0][1]]
    check_separator(header)
    rows = [
        Row(line, cells)
        if len(cells) == len(header)
        else Row(line, reason=f"has {len(cells)} fields where the header has {len(header)}")
        for line, cells in read[1:]
    ]
    _refuse_mixed(header, rows)
    return table_of(header, rows, value_of_text)


def _refuse_mixed(header: Sequence[str], rows: Sequence[Row]) -> None:
    """Refuse a column of truths that says some in words and some in digits: two logs, or a slip."""
    if "object_present" not in header:
        return
    at = header.index("object_present")
    said = {row.cells[at].strip().lower() for row in rows if not row.reason}
    # a word that is neither is named in its row
    if said <= {"1", "0", "true", "false"} and said & {"1", "0"} and said & {"true", "false"}:
        raise InvalidInputError.at(
            "/object_present", "mixes 1 and 0 with true and false: write all rows in one form"
        )


def check_separator(header: Sequence[str]) -> None:
    """Refuse a header whose names are separated by something else than commas.

    Parameters
    ----------
    header : sequence of str
        The names, as commas separate them.

    Raises
    ------
    MalformedError
        With a hint.
    """
    for separator in _SEPARATORS:
        # a unit in brackets, or a comment in words, is no second column
        if any(sum(map(bool, map(meant, name.split(separator)))) > 1 for name in header):
            raise MalformedError(
                f"columns must be separated by commas: is the file separated by {separator!r}?"
            )


def _field(value: float | bool | None) -> str:
    return "" if value is None else json.dumps(value, allow_nan=False)


def write_frames(path: Path, columns: Mapping[str, Sequence[float | bool | None]]) -> None:
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
    check_suffix(suffix, "written to")
    if suffix == ".json":
        text = json.dumps(columns, allow_nan=False) + "\n"
    else:
        rows = zip(*columns.values(), strict=True)
        if suffix == ".ndjson":
            frames = (dict(zip(columns, row, strict=True)) for row in rows)
            text = "".join(json.dumps(frame, allow_nan=False) + "\n" for frame in frames)
        else:
            lines = (",".join(map(_field, row)) for row in rows)
            text = "\n".join([",".join(columns), *lines]) + "\n"
    path.write_text(text, encoding="utf-8")


_READERS: Mapping[str, Callable[[bytes], FrameTable]] = {
    ".csv": _from_csv,
    ".ndjson": _from_ndjson,
    ".json": _from_json,
}
SUFFIXES = tuple(_READERS)
