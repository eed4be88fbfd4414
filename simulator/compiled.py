"""One way to compile a numerical kernel.

Kernels call one another across files, but numba's own cache looks at the caller's file alone: after
an edit of the callee it would go on running the old machine code. The cache directory is therefore
named by a digest of every file that holds a kernel.
"""

import functools
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

__all__ = ["compiled"]

P = ParamSpec("P")
R = TypeVar("R")

_config: Any = numba.config  # its attributes are made at import, out of a type checker's sight
_PACKAGES = ("simulator", "inference")
_MARK = b"from simulator.compiled import compiled"


@functools.cache
def _cache_directory() -> str | None:
    """Directory for machine code of exactly these sources; None where nothing can be written."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            source = path.read_bytes()
            if _MARK in source:
                digest.update(str(path.relative_to(root)).encode())
                digest.update(source)
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        directory = (Path(base) if base else Path.home() / ".cache") / "hybridtof"
        directory = directory / digest.hexdigest()[:16]
        directory.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home, or a read-only one: compile in memory
        return None
    return str(directory) if os.access(directory, os.W_OK) else None


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a pure function of numbers, tuples and arrays to machine code.

    An argument that is None is known to be None at compile time, so that ``if background is not
    None`` costs nothing: a term that a scene lacks is absent from the machine code. Division by
    zero gives inf or nan as in numpy; the interpreter lock is released; no fast-math, because
    error-free transformations and tests for nan must survive.
    """
    directory = _cache_directory()
    previous = _config.CACHE_DIR
    _config.CACHE_DIR = directory or previous
    try:
        dispatcher = numba.njit(
            cache=directory is not None, nogil=True, error_model="numpy", fastmath=False
        )(function)
    finally:
        _config.CACHE_DIR = previous
    return cast("Callable[P, R]", dispatcher)
