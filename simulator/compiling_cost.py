"""What making machine code would take, as far as can be told before."""

import functools
from types import FunctionType
from typing import Any

from simulator.uncompiled import used

__all__ = ["make_s", "note_made"]

# of a function that a kernel is made of: that has no machine code, and that has some already [s]
_NEW_S, _MADE_S = 0.1, 0.01
# kinds of named tuples with which there is machine code of a function
_made: dict[FunctionType, set[Any]] = {}


@functools.cache
def _parts(function: FunctionType) -> frozenset[FunctionType]:
    """Return the functions that a kernel is made of."""
    seen: set[FunctionType] = set()
    ahead = [function]
    while ahead:
        one = ahead.pop()
        if one in seen:
            continue
        seen.add(one)
        for name in used(one.__code__):
            found = getattr(one.__globals__.get(name), "__wrapped__", None)
            if isinstance(found, FunctionType):
                ahead.append(found)
    return frozenset(seen)


def _tuples(kind: Any) -> set[Any]:
    """Return the kinds of all named tuples in a kind of arguments."""
    found: set[Any] = set()
    if isinstance(kind, tuple) and isinstance(kind[0], type | tuple):
        if isinstance(kind[0], type) and hasattr(kind[0], "_fields"):
            found.add(kind)
        for part in kind:
            found |= _tuples(part)
    return found


def note_made(function: FunctionType, kind: Any) -> None:
    """Remember that there is machine code of a kernel, and of all that it is made of.

    Parameters
    ----------
    function : function
        Of a kernel.
    kind : tuple
        Of its arguments (`simulator.uncompiled.kind_of`).
    """
    tuples = _tuples(kind)
    make_s.cache_clear()
    for part in _parts(function):
        _made.setdefault(part, set()).update(tuples)


@functools.cache
def make_s(function: FunctionType, kind: Any) -> float:
    """Return what making machine code of a kernel would take, about [s].

    Much less where another kernel of the same functions and named tuples was compiled before.

    Parameters
    ----------
    function : function
        Of the kernel.
    kind : tuple
        Of its arguments (`simulator.uncompiled.kind_of`).
    """
    tuples, none = _tuples(kind), set[Any]()
    parts = _parts(function)
    made = sum(part in _made and tuples <= _made.get(part, none) for part in parts)
    return _NEW_S * (len(parts) - made) + _MADE_S * made
