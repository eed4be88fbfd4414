"""Kernels whose machine code is put where kernels call them.

A call hands over each member of each named tuple, whether it is looked at or not. The compiler
spares that where it puts what is called in the place of the call, as it does with what is small;
of what is called for every frame and every node of an integral it is told to.
"""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from simulator.compiled import Kernel

__all__ = ["inlined"]

P = ParamSpec("P")
R = TypeVar("R")


def inlined(kernel: Callable[P, R]) -> Callable[P, R]:
    """Have the machine code of a kernel put where kernels call it."""
    cast("Kernel", kernel).options["forceinline"] = True
    return kernel
