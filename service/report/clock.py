"""What a call costs: processor time, and the most memory that it holds."""

import math
import time
import tracemalloc
from collections.abc import Callable
from typing import TypeVar

import numpy as np

__all__ = ["alone", "best", "peak_bytes", "timed"]

T = TypeVar("T")

_REPEATS = 3


def timed(action: Callable[[], T]) -> tuple[T, float]:
    """Return a result and the processor time that it took [s]."""
    begin = time.process_time()
    result = action()
    return result, time.process_time() - begin


def best(action: Callable[[], T]) -> tuple[T, float]:
    """Run once for the compiler; return a result and the shortest time of three runs [s]."""
    result, shortest = action(), math.inf
    for _ in range(_REPEATS):
        result, seconds = timed(action)
        shortest = min(shortest, seconds)
    return result, shortest


def peak_bytes(action: Callable[[], object]) -> int:
    """Return the most memory that Python and numpy hold during a call, beyond that before it."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        action()
        return max(tracemalloc.get_traced_memory()[1] - before, 0)
    finally:
        tracemalloc.stop()


def alone(calls: list[Callable[[], object]]) -> tuple[float, float]:
    """Return median and 99 % quantile of the time of calls one by one [s]."""
    seconds = []
    for call in calls:
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    middle, tail = np.quantile(seconds, [0.5, 0.99]).tolist()
    return float(middle), float(tail)
