"""What a call costs: processor time, and the most memory that it holds."""

import math
import time
import tracemalloc
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from simulator import processor_time

__all__ = ["alone", "best", "peak_bytes", "quantiles", "timed", "traced"]

T = TypeVar("T")

_REPEATS = 3
# a call that takes this long is timed well enough by once more [s]
_LONG_S = 0.3


def timed(action: Callable[[], T]) -> tuple[T, float]:
    """Return a result and the processor time that it took, the making of machine code apart [s]."""
    return processor_time.timed(action)


def best(action: Callable[[], T]) -> tuple[T, float]:
    """Run once to load machine code; return a result and the shortest time of three runs [s].

    Of a long call one run is enough.
    """
    result, shortest, spent = action(), math.inf, 0.0
    for _ in range(_REPEATS):
        result, seconds = timed(action)
        shortest, spent = min(shortest, seconds), spent + seconds
        if spent > _LONG_S:
            break
    return result, shortest


def traced(action: Callable[[], T]) -> tuple[T, int]:
    """Return a result, and the most memory that Python and numpy held beyond that before."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        result = action()
        return result, max(tracemalloc.get_traced_memory()[1] - before, 0)
    finally:
        tracemalloc.stop()


def peak_bytes(action: Callable[[], object]) -> int:
    """Return the most memory that Python and numpy hold during a call, beyond that before it."""
    return traced(action)[1]


def alone(calls: list[Callable[[], object]]) -> tuple[float, float]:
    """Return median and 99 % quantile of the processor time of calls one by one [s]."""
    seconds = []
    for call in calls:
        begin = time.process_time()
        call()
        seconds.append(time.process_time() - begin)
    return quantiles(seconds)


def quantiles(seconds: Sequence[float]) -> tuple[float, float]:
    """Return the median and the 99 % quantile of times [s]."""
    middle, tail = np.quantile(seconds, [0.5, 0.99]).tolist()
    return float(middle), float(tail)
