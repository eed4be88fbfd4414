"""One way to compile a numerical kernel.

Kernels call one another across files, but numba's own cache looks at the caller's file alone: after
an edit of the callee it would go on running the old machine code. The cache directory of a file is
therefore named by a digest of it and of every file of kernels that it uses, directly or not.
"""

import functools
import hashlib
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

__all__ = ["compiled", "compiled_for_both"]

P = ParamSpec("P")
R = TypeVar("R")

_config: Any = numba.config  # its attributes are made at import, out of a type checker's sight
_njit: Any = numba.njit  # its stubs know a part of its options
_ROOT = Path(__file__).resolve().parents[1]
_MARK = b"from simulator.compiled import compiled"
_IMPORT = re.compile(rb"^from ((?:simulator|inference)[\w.]*) import ", re.MULTILINE)


@functools.cache
def _read(path: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return the source of a file of kernels and the files that it imports; neither of others."""
    if not path.is_file():
        return b"", ()
    source = path.read_bytes()
    if _MARK not in source:
        return b"", ()
    used: list[Path] = []
    for name in _IMPORT.findall(source):
        there = _ROOT.joinpath(*name.decode().split("."))
        # of a package any module may be meant
        used += sorted(there.glob("*.py")) if there.is_dir() else [there.with_suffix(".py")]
    return source, tuple(used)


@functools.cache
def _digest(path: Path) -> str:
    """Return a digest of a file and of every file of kernels that it uses, directly or not."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        here = ahead.pop()
        if here not in seen:
            seen.add(here)
            ahead += _read(here)[1]
    digest = hashlib.sha256(path.read_bytes())
    for one in sorted(seen):
        source, _ = _read(one)
        if source:
            digest.update(os.path.relpath(one, _ROOT).encode())
            digest.update(source)
    return digest.hexdigest()[:16]


def _cache_directory(path: Path) -> str | None:
    """Directory for machine code of exactly these sources; None where nothing can be written."""
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        directory = (Path(base) if base else Path.home() / ".cache") / "hybridtof"
        directory = directory / _digest(path)
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home, or a read-only one: compile in memory
        return None
    return str(directory) if os.access(directory, os.W_OK) else None


def _dispatcher(
    function: Callable[P, R], directory: str | None, **options: bool
) -> Any:  # numba's classes carry no types
    """Return numba's dispatcher of a function, with its machine code in a directory of its own."""
    previous = _config.CACHE_DIR
    _config.CACHE_DIR = directory or previous
    try:
        return _njit(
            cache=directory is not None,
            nogil=True,
            error_model="numpy",
            fastmath=False,
            no_cfunc_wrapper=True,  # nothing here is called from C
            **options,
        )(function)
    finally:
        _config.CACHE_DIR = previous


def _answer_calls(kernel: Any, called: Any) -> None:
    """Let the machine code of one dispatcher answer the calls of kernels to another.

    A number that a caller writes out is one of its type there: as numba has it, a type of its own,
    a kernel is compiled anew for every 0 and 1.
    """
    template: Any = called.get_call_template
    unliteral: Any = numba.types.unliteral

    def of_types(args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        kinds = {name: unliteral(kind) for name, kind in kws.items()}
        return template(tuple(map(unliteral, args)), kinds)

    kernel.get_call_template, kernel.get_overload = of_types, called.get_overload


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a pure function of numbers, tuples and arrays to machine code.

    An argument that is None is known to be None at compile time, so that ``if background is not
    None`` costs nothing: a term that a scene lacks is absent from the machine code. Division by
    zero gives inf or nan as in numpy; the interpreter lock is released; no fast-math, because
    error-free transformations and tests for nan must survive.

    A kernel that another kernel calls needs no way in from Python, whose opening of named tuples
    takes a sixth of the whole time of compiling: kernels call a twin without it, kept apart.
    """
    directory = _cache_directory(Path(function.__code__.co_filename).resolve())
    kernel = _dispatcher(function, directory)
    below = None if directory is None else str(Path(directory) / "called")
    kernel.called = _dispatcher(function, below, no_cpython_wrapper=True)
    _answer_calls(kernel, kernel.called)
    return cast("Callable[P, R]", kernel)


def compiled_for_both(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that Python and kernels call with arguments of the same types: once."""
    kernel = _dispatcher(function, _cache_directory(Path(function.__code__.co_filename).resolve()))
    _answer_calls(kernel, kernel)
    return cast("Callable[P, R]", kernel)
