"""All real roots of a polynomial of low degree in an interval."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.bracketing import STEPS, best, narrowed, next_point, start
from inference.realtime.solving.exact import difference_of_products
from simulator.compiled import compiled, compiled_for_both

__all__ = ["fill", "horner", "real_roots"]

Array = NDArray[np.float64]


@compiled
def fill(coefficients: Array, values: tuple[float, ...]) -> None:
    """Write a tuple into an array: a slice would compile numpy's errors, for seconds."""
    for i in range(len(values)):
        coefficients[i] = values[i]


@compiled
def horner(coefficients: Array, count: int, x: float) -> float:
    """Return the polynomial of the first ``count`` coefficients, highest power first, at x."""
    total = 0.0
    for i in range(count):
        total = total * x + coefficients[i]
    return total


@compiled
def _bracketed(coefficients: Array, count: int, low: float, high: float) -> float:
    f_low, f_high = horner(coefficients, count, low), horner(coefficients, count, high)
    bracket = start(low, high, f_low, f_high)
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, horner(coefficients, count, x))
    return best(bracket)


@compiled
def _quadratic(a: float, b: float, c: float, low: float, high: float, out: Array) -> int:
    """Roots in (low, high) where the sign changes, without cancellation."""
    found = 0
    if a == 0.0:
        first, second = (-c / b if b != 0.0 else math.nan), math.nan
    else:
        discriminant = difference_of_products(b, b, 4.0 * a, c)
        if not discriminant > 0.0:
            return 0
        sum_of_larger = -0.5 * (b + math.copysign(math.sqrt(discriminant), b))
        first, second = sum_of_larger / a, c / sum_of_larger
    if first > second:
        first, second = second, first
    if low < first < high:
        out[found] = first
        found += 1
    if low < second < high:
        out[found] = second
        found += 1
    return found


@compiled_for_both
def real_roots(coefficients: Array, low: float, high: float, out: Array) -> int:
    """Find every sign change of a polynomial in (low, high).

    The roots of each derivative part the interval into monotone pieces of the one before it, so
    none is missed; a double root, where the sign does not change, is not reported.

    Parameters
    ----------
    coefficients : ndarray, shape (d + 1,)
        Highest power first; leading zeros are allowed, all zeros have no roots.
    low, high : float
        Open interval, 0 <= low < high.
    out : ndarray, shape (at least d,)
        Receives the roots, ascending.

    Returns
    -------
    int
        Number of roots.
    """
    degree = coefficients.size - 1
    positive = negative = False
    for i in range(degree + 1):
        positive |= coefficients[i] > 0.0
        negative |= coefficients[i] < 0.0
    if not (positive and negative):  # Descartes
        return 0
    if degree == 2:
        return _quadratic(coefficients[0], coefficients[1], coefficients[2], low, high, out)
    derivative = np.empty(degree + 1)
    previous = np.empty(degree + 2)
    found = 0
    for order in range(max(degree - 2, 0), -1, -1):
        # coefficients of the derivative of this order
        count = degree - order + 1
        for i in range(count):
            factor = 1.0
            for j in range(order):
                factor *= degree - i - j
            derivative[i] = coefficients[i] * factor
        if count == 3:
            found = _quadratic(derivative[0], derivative[1], derivative[2], low, high, out)
            continue
        previous[0] = low
        for i in range(found):
            previous[i + 1] = out[i]
        previous[found + 1] = high
        points = found + 2
        found = 0
        left = horner(derivative, count, previous[0])
        for i in range(1, points):
            right = horner(derivative, count, previous[i])
            if (left > 0.0 and right <= 0.0) or (left < 0.0 and right >= 0.0):
                root = previous[i]
                if right != 0.0:
                    root = _bracketed(derivative, count, previous[i - 1], previous[i])
                if low < root < high and math.isfinite(root):
                    out[found] = root
                    found += 1
            if right != 0.0:
                left = right
    return found
