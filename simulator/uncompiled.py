"""Kernels as Python runs them: the same numbers to the last bit, without a compiler.

A kernel that is asked for the first time is answered so, as long as that takes less than compiling
it would. What machine code and the interpreter do differently is mended here: numbers that a kernel
writes out, and those that it is given, are numpy's, which divide by zero without a word; functions
of `math` give inf and nan where Python raises; a length is hypot of the C library.
"""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from simulator.by_arrays import by_arrays

__all__ = ["NotSoError", "free", "kind_of", "run", "size", "twin", "used"]

_Float = np.float64
# packages whose functions are run so wherever they are used
_OWN = ("simulator", "inference", "tests")
# turns, and loops, between looks at the clock, which is that of this thread's own work
_STRETCH, _LOOPS = 256, 63
_clock = time.thread_time
# of one run; the interpreter runs one at a time in any case
_turn = threading.Lock()
_limit = [math.inf]
_loops = [0]


class NotSoError(Exception):
    """The interpreter does not come to an answer, or not in time."""


def _in_time(*bounds: int) -> Any:
    """Stand for `range`, and end what takes too long: no kernel runs long without a loop."""
    _loops[0] += 1
    found = range(*bounds)
    if _loops[0] == 1:
        return _outermost(found)
    if not _loops[0] & _LOOPS and _clock() > _limit[0]:
        raise NotSoError("takes too long")
    return found if len(found) <= _STRETCH else _stretches(found)


def _outermost(whole: range) -> Iterator[int]:
    """Give up as soon as the turns so far tell that there are too many."""
    began = _clock()
    for number, turn in enumerate(whole):
        yield turn
        done = number + 1
        if done > 1 and not done & number:  # after 2, 4, 8, ...
            each_s = (_clock() - began) / done
            if began + each_s * len(whole) > _limit[0]:
                raise NotSoError("would take too long")


def _stretches(whole: range) -> Iterator[int]:
    for first in range(0, len(whole), _STRETCH):
        if _clock() > _limit[0]:
            raise NotSoError("takes too long")
        yield from whole[first : first + _STRETCH]


def _total(name: str) -> Callable[..., Any]:
    """Return a function of `math` with the values of the C library where Python raises."""
    function: Callable[..., float] = getattr(math, name)

    def total(x: float, *more: float) -> Any:
        try:
            return _Float(function(x, *more))
        except OverflowError:
            return _Float(math.copysign(math.inf, x) if name == "sinh" else math.inf)
        except ValueError:
            return _Float(math.nan)

    return total


def _log(x: float) -> Any:
    return _Float(math.log(x) if x > 0.0 else -math.inf if x == 0.0 else math.nan)


def _log1p(x: float) -> Any:
    return _Float(math.log1p(x) if x > -1.0 else -math.inf if x == -1.0 else math.nan)


def _sqrt(x: float) -> Any:
    return _Float(math.sqrt(x) if x >= 0.0 else math.nan)


def _frexp(x: float) -> Any:
    part, power = math.frexp(x)
    return _Float(part), power


def _ldexp(x: float, power: int) -> Any:
    try:
        return _Float(math.ldexp(x, power))
    except OverflowError:
        return _Float(math.copysign(math.inf, x))


def _pow(x: float, power: float) -> Any:
    return _Float(x) ** _Float(power)


# the others are as Python has them, or are no part of what kernels may use
_MATH = SimpleNamespace(
    pi=_Float(math.pi),
    inf=_Float(math.inf),
    nan=_Float(math.nan),
    log=_log,
    log1p=_log1p,
    sqrt=_sqrt,
    frexp=_frexp,
    ldexp=_ldexp,
    pow=_pow,
    hypot=np.hypot,  # Python's own rounds otherwise
    floor=math.floor,
    ceil=math.ceil,
    isfinite=math.isfinite,
    isnan=math.isnan,
    **{
        name: _total(name)
        for name in (
            *("exp", "expm1", "sinh", "cosh", "asinh", "copysign", "erfc"),
            *("sin", "cos", "tan", "asin", "acos", "atan", "atan2"),
        )
    },
)


class _Module:
    """A module of kernels, as seen by kernels that run so."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        value = _seen(getattr(self._module, name))
        setattr(self, name, value)
        return value


_names: dict[str, dict[str, Any]] = {}
_twins: dict[Callable[..., Any], Callable[..., Any]] = {}


def _seen(value: Any) -> Any:
    """Return what a kernel that runs so sees in the place of a global value."""
    if value is math:
        return _MATH
    function = getattr(value, "__wrapped__", value)
    if isinstance(function, FunctionType) and function.__module__.startswith(_OWN):
        return twin(function)
    if isinstance(value, ModuleType) and value.__name__.startswith(_OWN):
        return _Module(value)
    return _number(value)


def _number(value: Any) -> Any:
    kind = type(value)
    if kind is float:
        return _Float(value)
    if isinstance(value, tuple):
        parts = map(_number, value)
        return kind(parts) if kind is tuple else kind(*parts)
    return value


def _constant(value: Any) -> Any:
    return _code(value) if isinstance(value, CodeType) else _number(value)


def _code(code: CodeType) -> CodeType:
    return code.replace(co_consts=tuple(map(_constant, code.co_consts)))


def used(code: CodeType) -> set[str]:
    """Return the names that a function uses, and those within it."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= used(constant)
    return names


def twin(function: Any) -> Callable[..., Any]:
    """Return a kernel, or its function, as the interpreter is to run it."""
    function = getattr(function, "__wrapped__", function)
    made = _twins.get(function)
    if made is None:
        module = sys.modules[function.__module__]
        names = _names.setdefault(
            module.__name__, {"__builtins__": __builtins__, "range": _in_time, "float": _Float}
        )
        defaults = tuple(map(_number, function.__defaults__ or ()))
        plain = FunctionType(_code(function.__code__), names, function.__name__, defaults)
        made = by_arrays(function, plain)
        _twins[function] = made  # before its names are looked up: kernels may call one another
        for name in used(function.__code__):
            if name in function.__globals__ and name not in names:
                names[name] = _seen(function.__globals__[name])
    return made


def kind_of(value: Any) -> Any:
    """Return what decides which machine code an argument needs."""
    kind = type(value)
    if kind is float:  # nearly all are
        return kind
    if isinstance(value, tuple):
        return kind, *map(kind_of, value)
    if isinstance(value, np.ndarray):
        return value.dtype.char, value.ndim, value.flags.c_contiguous, value.flags.writeable
    return kind


def _arrays(values: Any) -> list[np.ndarray[Any, Any]]:
    found: list[np.ndarray[Any, Any]] = []
    for value in values:
        if isinstance(value, tuple):
            found += _arrays(value)
        elif isinstance(value, np.ndarray):
            found.append(value)
    return found


def size(arguments: tuple[Any, ...]) -> int:
    """Return the number of elements of all arrays."""
    return sum(array.size for array in _arrays(arguments))


def _plain(value: Any) -> Any:
    """Return a result with Python's numbers, as machine code does."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        kind, parts = type(value), map(_plain, value)
        return kind(parts) if kind is tuple else kind(*parts)
    return value


def free() -> bool:
    """Tell whether no other thread runs a kernel without a compiler."""
    return not _turn.locked()


def run(function: Any, arguments: tuple[Any, ...], most_s: float) -> tuple[Any, float]:
    """Run a kernel without a compiler.

    Parameters
    ----------
    function : function
        Of a kernel.
    arguments : tuple
        Its arguments. Arrays that it has written to are as before where it comes to no end.
    most_s : float
        Time after which it is given up [s].

    Returns
    -------
    (object, float)
        What machine code would return, and what it took [s].

    Raises
    ------
    NotSoError
        Where it takes longer, or does what Python refuses.
    """
    kept = [(array, array.copy()) for array in _arrays(arguments) if array.flags.writeable]
    with _turn, np.errstate(all="ignore"):
        began = _clock()
        _limit[0], _loops[0] = began + most_s, 0
        try:
            answer = _plain(twin(function)(*map(_number, arguments)))
            return answer, _clock() - began
        except (NotSoError, ArithmeticError, ValueError, IndexError) as error:
            for array, before in kept:
                array[...] = before
            raise NotSoError(str(error)) from None
        finally:
            _limit[0] = math.inf  # what is run outside is under no limit
