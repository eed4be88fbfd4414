"""Loops of kernels as arithmetic of arrays, for the interpreter alone: the same bits, sooner.

Beside a file of kernels `x.py` there may be an `x_by_arrays.py` with functions of the same names
and arguments. Where one gives `NotImplemented` the interpreter runs the kernel's own loop. Machine
code has nothing of it, and need not be made anew for it.
"""

import functools
import importlib.util
from collections.abc import Callable
from types import ModuleType
from typing import Any

__all__ = ["by_arrays"]


@functools.cache
def _beside(name: str) -> ModuleType | None:
    """Return the file beside a file of kernels that has some of them by arrays, if there is one."""
    beside = f"{name}_by_arrays"
    return importlib.import_module(beside) if importlib.util.find_spec(beside) else None


def by_arrays(function: Any, plain: Callable[..., Any]) -> Callable[..., Any]:
    """Return what does a kernel's work by arrays where it can.

    Parameters
    ----------
    function, plain : function
        Of the kernel, and as the interpreter is to run it otherwise.
    """
    quick = getattr(_beside(function.__module__), function.__name__, None)
    if quick is None:
        return plain

    def answer(*args: Any) -> Any:
        found = quick(*args)
        return plain(*args) if found is NotImplemented else found

    return answer
