"""Files of the command line, read so that an error names the file and the field in it."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from service.errors import MalformedError
from service.frame_files import read_frames
from service.strict_json import check_bulk, decode
from simulator.errors import InvalidInputError, Problem
from simulator.frames import FrameColumns
from simulator.validated import Validated, parse

__all__ = ["naming", "read_columns", "read_data", "read_document"]

T = TypeVar("T", bound=Validated)


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
def _reading(path: Path) -> Iterator[None]:
    """Let errors raised inside name the file."""
    try:
        with naming({"": str(path)}):
            yield
    except MalformedError as error:
        raise MalformedError(f"{path}: {error}") from None
    except OSError as error:
        # a file that opens, but cannot be read, is not named
        error.filename = error.filename or str(path)
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
    path : Path
        The file.

    Returns
    -------
    Validated
        An instance of ``model``.

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
    with _reading(path):
        data = decode(path.read_bytes())
        check_bulk(data)
        return data


def read_columns(path: Path) -> FrameColumns:
    """Read a file of frames; see `read_frames` for what is raised, naming the file."""
    with _reading(path):
        return read_frames(path)
