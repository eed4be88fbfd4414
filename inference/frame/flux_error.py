"""A smooth curve of log r that multiplies the object's flux: cubic between knots."""

import numpy as np
from numpy.typing import NDArray

from inference.frame.arguments import FluxError, Pair
from simulator.compiled import compiled

__all__ = ["cubic_weights", "fill_knots", "flux_error_at", "slope_weights"]

Array = NDArray[np.float64]


@compiled
def cubic_weights(
    u: float, first: float, rate: float, count: int
) -> tuple[int, float, float, float, float]:
    """Return the knot left of u and the weights of its and the next one's value and slope."""
    x = min(max((u - first) * rate, 0.0), count - 1.0)
    i = min(int(x), count - 2)
    t = x - i
    rest = 1.0 - t
    return (
        i,
        rest * rest * (1.0 + 2.0 * t),
        rest * rest * t,
        t * t * (3.0 - 2.0 * t),
        -t * t * rest,
    )


@compiled
def slope_weights(
    u: float, first: float, rate: float, count: int
) -> tuple[int, float, float, float]:
    """Return the knot left of u and what the slope there takes of rise and slopes; 0 outside."""
    x = (u - first) * rate
    i = min(int(max(x, 0.0)), count - 2)
    if x <= 0.0 or x >= count - 1.0:
        return i, 0.0, 0.0, 0.0
    t = x - i
    rest = 1.0 - t
    return i, 6.0 * t * rest * rate, rest * (1.0 - 3.0 * t) * rate, t * (3.0 * t - 2.0) * rate


@compiled
def flux_error_at(u: float, flux_error: FluxError) -> Pair:
    """Return value and derivative at u; beyond the knots the curve is constant."""
    knots, first, rate = flux_error
    i, a, b, c, d = cubic_weights(u, first, rate, knots.shape[0])
    value = a * knots[i, 0] + b * knots[i, 1] + c * knots[i + 1, 0] + d * knots[i + 1, 1]
    i, a, b, c = slope_weights(u, first, rate, knots.shape[0])
    slope = a * (knots[i + 1, 0] - knots[i, 0]) + b * knots[i, 1] + c * knots[i + 1, 1]
    return value, slope


@compiled
def fill_knots(knots: Array, basis: Array, coefficients: Array) -> None:
    """Fill the knots of a curve from coefficients; basis has shape (knots, 2, functions)."""
    for i in range(basis.shape[0]):
        for part in range(2):
            total = 0.0
            for k in range(coefficients.size):
                total += basis[i, part, k] * coefficients[k]
            knots[i, part] = total
