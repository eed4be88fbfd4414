"""Work that is counted, not timed: the same on every machine, and under every load."""

import math
import sys
import tracemalloc
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from simulator import uncompiled
from simulator.compiled import Kernel

__all__ = ["counted_calls", "counting", "peak_bytes", "types_asked_for"]


def counted_calls(kernel: Any, *args: Any) -> tuple[Any, Counter[str]]:
    """Run a kernel by the interpreter; return its answer, and how often each function was called.

    Functions are named by their file: ``newton.solve_between``. The interpreter takes the same
    steps as machine code, to the last bit.
    """
    found: Counter[str] = Counter()

    def see(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            code = frame.f_code
            found[f"{Path(code.co_filename).stem}.{code.co_name}"] += 1

    before = sys.getprofile()
    sys.setprofile(see)
    try:
        answer, _ = uncompiled.run(kernel.__wrapped__, args, math.inf)
    finally:
        sys.setprofile(before)
    return answer, found


def counting(kernel: Any, total: Counter[str]) -> Callable[..., Any]:
    """Return what stands for a kernel and adds the calls that it makes to a total."""

    def counted(*args: Any) -> Any:
        answer, found = counted_calls(kernel, *args)
        total.update(found)
        return answer

    return counted


def types_asked_for(monkeypatch: pytest.MonkeyPatch) -> dict[str, set[Any]]:
    """Return kinds of arguments by kernel, filled from now on: each needs machine code of its own.

    Only calls by Python count, of which each compiles all that it uses.
    """
    asked: dict[str, set[Any]] = {}
    call = Kernel.__call__

    def seen(self: Any, *args: Any, **kwargs: Any) -> Any:
        name = f"{self.__module__}.{self.__qualname__}"
        asked.setdefault(name, set()).add(uncompiled.kind_of(args))
        return call(self, *args, **kwargs)

    monkeypatch.setattr(Kernel, "__call__", seen)
    return asked


def peak_bytes(work: Callable[[], object]) -> int:
    """Return how much more memory is held at the peak of some work than before it [bytes]."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
