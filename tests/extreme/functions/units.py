"""Errors of numbers in units of their condition times rounding."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from flint import arb, arb_series, ctx

from tests.extreme.balls import exact

__all__ = ["EPSILON", "Numbers", "between", "slope", "units"]

EPSILON = float(np.finfo(float).eps)
_BITS = 512
_MOVED = exact(2.0**-200)
_LEAST = exact(1e-290)  # what underflows has lost its digits
Numbers = Mapping[str, arb]


def units(function: Callable[[Numbers], arb], numbers: Mapping[str, float], found: float) -> float:
    """Return the error of a function's value.

    Parameters
    ----------
    function : callable
        In balls.
    numbers : mapping of str to float
        What goes in, as binary numbers.
    found : float
        Its value.

    Returns
    -------
    float
        The condition is the value's size and what a relative change of each number moves it by.
    """
    ctx.prec = _BITS
    of = {name: exact(x) for name, x in numbers.items()}
    right = function(of)
    condition = abs(right)
    for name, x in of.items():
        moved = function({**of, name: x * (1 + _MOVED)})
        condition += abs(moved - right) / _MOVED
    if not math.isfinite(found):
        return math.inf
    unit = (condition + _LEAST / exact(EPSILON)) * exact(EPSILON)
    return float((abs(exact(found) - right) / unit).mid())


def slope(function: Callable[[Numbers], Any], of: Numbers, along: str) -> arb:
    """Return the derivative of a function along one of its numbers."""
    series: dict[str, Any] = {**of, along: arb_series([of[along], 1], prec=2)}
    value: Any = function(series)
    return value[1] if isinstance(value, arb_series) else arb(0)


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number evenly in its logarithm to ten."""
    return float(10.0 ** rng.uniform(low, high))
