"""Kernels whose machine code is made for them as a whole, with all that they call.

numba leaves what a kernel calls open to others. Every call then hands over each member of each
named tuple, whether it is looked at or not, and may come from anywhere with anything: that was half
of the time of a frame. What nobody else may call is made for the calls that there are, with the
same arithmetic and the same bits. To make it takes up to half as long again, so that it is for
kernels that run for long: the tracker's, and those that evaluate and draw what a posterior asks.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from simulator.compiled import Kernel

__all__ = ["CLOSED", "closed"]

P = ParamSpec("P")
R = TypeVar("R")

CLOSED = "_closed"
"""Option of a kernel that says so."""


def closed(kernel: Callable[P, R]) -> Callable[P, R]:
    """Have the machine code of a kernel that Python calls made as a whole."""
    cast("Kernel", kernel).options[CLOSED] = True
    return kernel
