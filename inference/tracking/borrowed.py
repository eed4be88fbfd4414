"""Kernels that only look into arrays which others own, and need not count who does.

A named tuple of arrays costs two atomic operations an array and a call, which was half of the time
of a frame. A borrowed kernel and all that it calls make no array, and none that it returns is kept
by a kernel that counts. Each says so itself: one that was compiled before keeps what it was.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from simulator.compiled import Kernel

__all__ = ["borrowed"]

P = ParamSpec("P")
R = TypeVar("R")


def borrowed(kernel: Callable[P, R]) -> Callable[P, R]:
    """Have a compiled kernel leave the reference counts of its arrays alone."""
    cast("Kernel", kernel).options["_nrt"] = False
    return kernel
