"""Files of the command line, read so that an error names the file and the field in it."""

import contextlib
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from service.errors import MalformedError
from service.frame_files import BYTE_ORDER_MARK, check_suffix, form_of
from service.frame_files import read_table as table_in
from service.frame_table import FrameTable
from service.strict_json import check_bulk, decode
from simulator.errors import InvalidInputError, Problem
from simulator.validated import Validated, parse

__all__ = [
    "check_folder",
    "naming",
    "open_lines",
    "read_data",
    "read_document",
    "read_table",
    "reading",
    "source",
]

T = TypeVar("T", bound=Validated)

_STANDARD_INPUT = Path("-")


@contextlib.contextmanager
def naming(sources: Mapping[str, str]) -> Iterator[None]:
    """Let errors raised inside name the source instead of the member of a request.

    Parameters
    ----------
    sources : mapping
        From the start of a pointer to where that member came from; the first match counts.
    """
    try:
        yield
    except InvalidInputError as error:
        raise InvalidInputError(*(_named(p, sources) for p in error.problems)) from None


@contextlib.contextmanager
def reading(path: Path) -> Iterator[None]:
    """Let errors raised inside name the file."""
    try:
        with naming({"": source(path)}):
            yield
    except MalformedError as error:
        raise MalformedError(f"{source(path)}: {error}") from None
    except OSError as error:
        # a file that opens, but cannot be read, is not named
        error.filename = error.filename or source(path)
        raise


def _named(problem: Problem, sources: Mapping[str, str]) -> Problem:
    for prefix, source in sources.items():
        if problem.pointer == prefix or problem.pointer.startswith(prefix + "/"):
            rest = problem.pointer.removeprefix(prefix)
            return Problem(f"{source}#{rest}" if rest else source, problem.message)
    return problem


def read_document(model: type[T], path: Path) -> T:
    """Read a JSON file as a validated type.

    Parameters
    ----------
    model : type
        A subclass of `Validated`.

    Raises
    ------
    InvalidInputError, MalformedError
        Naming the file.
    OSError
        Where it cannot be read, naming it.
    """
    with naming({"": str(path)}):
        return parse(model, read_data(path))


def read_data(path: Path) -> Any:
    """Read a JSON file as plain data; see `read_document` for what is raised."""
    with reading(path):
        data = decode(path.read_bytes().removeprefix(BYTE_ORDER_MARK))
        check_bulk(data)
        return data


def check_folder(option: str, path: Path) -> None:
    """Refuse a file whose folder is not there, before any time is spent on what goes into it.

    Raises
    ------
    InvalidInputError
        Naming the option.
    """
    if not path.parent.is_dir():
        raise InvalidInputError(Problem(f"{option} {path}", "there is no such folder"))


def source(path: Path) -> str:
    """Return how errors name a file of frames."""
    return "standard input" if path == _STANDARD_INPUT else str(path)


def read_table(path: Path) -> FrameTable:
    """Read frames from a file or from standard input.

    Parameters
    ----------
    path : Path
        ``-`` is standard input, whose form shows from how it begins.

    Raises
    ------
    InvalidInputError, MalformedError, OSError
        As `service.frame_files.read_table`, naming the file.
    """
    with reading(path):
        if path == _STANDARD_INPUT:
            raw = sys.stdin.buffer.read()
            return table_in(raw, form_of(raw))
        check_suffix(path.suffix)
        return table_in(path.read_bytes(), path.suffix)


@contextlib.contextmanager
def open_lines(path: Path) -> Iterator[Iterable[bytes]]:
    """Open a stream of frames, so that each line can be had as soon as it is there.

    Parameters
    ----------
    path : Path
        ``.ndjson`` or ``.csv``; ``-`` is standard input.

    Yields
    ------
    iterable of bytes
        Its lines; of an object of columns (``.json``) lines that are made of them.

    Raises
    ------
    MalformedError, OSError
        Where it cannot be opened, or its name does not say what it is.
    """
    if path == _STANDARD_INPUT:
        yield _unmarked(sys.stdin.buffer)
        return
    check_suffix(path.suffix)
    if path.suffix.lower() == ".json":
        columns = table_in(path.read_bytes(), path.suffix).columns.model_dump(exclude_unset=True)
        rows = zip(*columns.values(), strict=True)
        yield (json.dumps(dict(zip(columns, row, strict=True))).encode() for row in rows)
        return
    with path.open("rb") as lines:
        yield _unmarked(lines)


def _unmarked(lines: Iterable[bytes]) -> Iterator[bytes]:
    """Yield lines one by one, the first without a mark of the byte order."""
    for number, line in enumerate(lines):
        yield line.removeprefix(BYTE_ORDER_MARK) if number == 0 else line
