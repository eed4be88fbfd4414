"""Whether the kernel cache is warm, and a process that makes it so beside a service."""

import hashlib
import multiprocessing
import os
import platform
import sys
from collections.abc import Callable
from importlib.metadata import version
from multiprocessing.context import SpawnProcess
from pathlib import Path

from service.parent_death import end_with_parent
from simulator.kernel_cache import base_folder, digest_of_all

__all__ = ["Warming", "is_warm", "mark_warm"]


def _mark() -> Path | None:
    """Name the file that says that all machine code of these sources was made for this machine."""
    folder = base_folder()
    if folder is None:
        return None
    processor = os.environ.get("NUMBA_CPU_NAME") or platform.processor() or platform.machine()
    made_by = (digest_of_all(), version("numba"), platform.python_version(), processor)
    return folder.path / f"warm-{hashlib.sha256(repr(made_by).encode()).hexdigest()[:16]}"


def is_warm() -> bool:
    """Tell whether all machine code was made."""
    mark = _mark()
    return mark is not None and mark.exists()


def mark_warm() -> None:
    """Note that all machine code was made."""
    mark = _mark()
    if mark is not None:
        mark.touch()


def _work(warm: Callable[[], int]) -> None:
    """Warm the cache at the lowest priority, for no longer than the service lives."""
    end_with_parent()
    os.nice(19)
    sys.exit(warm())


class Warming:
    """``hybridtof warm`` beside a service, where there is a cache to be filled.

    Answers given meanwhile are the same, only slower.

    Parameters
    ----------
    warm : callable
        Fills the cache in the process; returns its exit code.
    """

    def __init__(self, warm: Callable[[], int]) -> None:
        self._warm = warm
        self._process: SpawnProcess | None = None

    def begin(self) -> None:
        """Start the process, if it is of any use, in a thread that outlives it."""
        folder = base_folder()
        if folder is None or not folder.writable:
            return
        if not is_warm():
            context = multiprocessing.get_context("spawn")
            self._process = context.Process(
                target=_work, args=(self._warm,), name="warm", daemon=True
            )
            self._process.start()

    @property
    def going(self) -> bool:
        """Whether machine code is being made."""
        return self._process is not None and self._process.is_alive()

    def end(self) -> None:
        """End the process; what it has made stays."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
