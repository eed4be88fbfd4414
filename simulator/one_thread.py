"""Linear algebra of many small steps, by one thread.

A fit or a posterior solves thousands of systems of some hundred rows. OpenBLAS, which numpy and
scipy bring along, parts each among all processors and lets the threads spin until the last is done:
where another program keeps a processor busy, every system waits for its turn there, and processor
time is burnt meanwhile.
"""

import contextlib
import ctypes
import functools
import importlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

__all__ = ["one_thread"]

# of libraries in the wheels: of numpy with integers of 64 bits, of scipy with such of 32
_PACKAGES = {"numpy": "64_", "scipy": ""}


class _Threads(NamedTuple):
    """How many threads a library has, to ask and to set."""

    get: Callable[[], int]
    set: Callable[[int], object]


class _Inside:
    """How many are within `one_thread`, and what was before the first."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.number = 0
        self.before: list[tuple[_Threads, int]] = []


_inside = _Inside()


@functools.cache
def _libraries() -> tuple[_Threads, ...]:
    """Find the OpenBLAS of numpy's and scipy's wheels; of another, or none, there is nothing."""
    # what asks for one thread uses it, and would load it afterwards
    importlib.import_module("scipy.linalg")
    found = []
    for package, suffix in _PACKAGES.items():
        root = Path(str(sys.modules[package].__file__)).parent
        for folder in (root.parent / f"{package}.libs", root / ".dylibs"):
            for file in folder.glob("libscipy_openblas*"):
                library = ctypes.CDLL(os.fspath(file))
                get = getattr(library, f"scipy_openblas_get_num_threads{suffix}", None)
                set_ = getattr(library, f"scipy_openblas_set_num_threads{suffix}", None)
                if get is not None and set_ is not None:
                    found.append(_Threads(get, set_))
    return tuple(found)


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let numpy and scipy compute by one thread meanwhile, in all threads of this process.

    Afterwards they have as many as before. Several may be inside at a time: the last one out
    restores. Only the OpenBLAS of their wheels is told; of another library nothing changes, and
    its own environment variables say.
    """
    with _inside.lock:
        if _inside.number == 0:
            before = [(library, library.get()) for library in _libraries()]
            _inside.before = [(library, n) for library, n in before if n > 1]
            for library, _ in _inside.before:
                library.set(1)
        _inside.number += 1
    try:
        yield
    finally:
        with _inside.lock:
            _inside.number -= 1
            if _inside.number == 0:
                for library, n in _inside.before:
                    library.set(n)
