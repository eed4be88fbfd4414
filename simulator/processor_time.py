"""Processor time of what is computed, apart from that of compiling kernels."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from simulator.compiled import given_up_s, when_compiling

__all__ = ["compiling_s", "timed", "uncounted", "watch_compiling"]

T = TypeVar("T")

_EVENT = "numba:compile"  # kernels whose machine code was found on the disk are not in it


class _Watch:
    """What was noticed."""

    def __init__(self) -> None:
        self.tell: Callable[[bool], None] = lambda _: None
        self.seconds = 0.0
        self.listening = False
        self._depth = 0
        self._began = 0.0

    def begin(self) -> None:
        """Take in a beginning: kernels that kernels call are compiled within one another."""
        self._depth += 1
        if self._depth == 1:
            self._began = time.process_time()
            self.tell(True)

    def end(self) -> None:
        """Take in an end."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.process_time() - self._began
            self.tell(False)


_watch = _Watch()


def watch_compiling(tell: Callable[[bool], None]) -> None:
    """Be told when compiling begins and ends, from now on.

    Parameters
    ----------
    tell : callable
        Gets True at the beginning and False at the end; takes the place of the one before.
    """
    _watch.tell = tell
    _watch_from_now()


def _watch_from_now() -> None:
    if not _watch.listening:
        _watch.listening = True
        when_compiling(_listen)


def _listen() -> None:
    from numba.core import event

    register: Any = event.register  # numba has no types here

    class Listener(event.Listener):
        def on_start(self, _: Any) -> None:
            _watch.begin()

        def on_end(self, _: Any) -> None:
            _watch.end()

    register(_EVENT, Listener())


@contextlib.contextmanager
def uncounted() -> Iterator[None]:
    """Let what is done inside count like compiling: it is done once in a process."""
    _watch.begin()
    try:
        yield
    finally:
        _watch.end()


def compiling_s() -> float:
    """Return the processor time that compiling has taken since it is watched [s].

    With it what was tried without a compiler, in vain.
    """
    return _watch.seconds + given_up_s()


def timed(function: Callable[..., T], *arguments: Any) -> tuple[T, float]:
    """Run a function and measure it, the making of machine code apart.

    Parameters
    ----------
    function : callable
        What to run.
    *arguments
        Its arguments.

    Returns
    -------
    tuple
        The result, and the processor time of this process [s].
    """
    _watch_from_now()
    before, compiled = time.process_time(), compiling_s()
    result = function(*arguments)
    return result, time.process_time() - before - (compiling_s() - compiled)
