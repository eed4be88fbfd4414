"""Differences and phases that must not cancel, because a sign or a count depends on them."""

import math
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.constants import SPEED_OF_LIGHT

__all__ = ["cycles_phase", "difference_of_products", "weighted_differences"]

Array = NDArray[np.float64]

_SPLIT = 134217729.0  # 2^27 + 1, Dekker's splitting constant


@compiled
def _product_error(a: float, b: float, product: float) -> float:
    """Return a b - product exactly (Dekker); the factors must be below 2^996."""
    big = _SPLIT * a
    a_high = big - (big - a)
    a_low = a - a_high
    big = _SPLIT * b
    b_high = big - (big - b)
    b_low = b - b_high
    return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


@compiled
def difference_of_products(a: float, b: float, c: float, d: float) -> float:
    """Return a b - c d with an error of two roundings, however much cancels."""
    first, second = a * b, c * d
    return (first - second) + (_product_error(a, b, first) - _product_error(c, d, second))


@compiled
def weighted_differences(x: Array, a: float, y: Array, b: float) -> Array:
    """Return a x - b y for arrays, without cancellation and without overflow on the way.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Readings of any finite size.
    a, b : float
        Factors of moderate size.
    """
    out = np.empty(x.size)
    for i in range(x.size):
        largest = max(abs(x[i]), abs(y[i]))
        exponent = math.frexp(largest)[1] if largest < math.inf else 0
        left, right = math.ldexp(x[i], -exponent), math.ldexp(y[i], -exponent)
        out[i] = math.ldexp(difference_of_products(a, left, b, right), exponent)
    return out


def cycles_phase(frequency: float, distance: float) -> float:
    """Return the round-trip phase 4 pi f R / c reduced to [0, 2 pi), correct to rounding.

    Parameters
    ----------
    frequency : float
        Modulation frequency [Hz].
    distance : float
        Distance [m].
    """
    cycles = 2 * Fraction(frequency) * Fraction(distance) / Fraction(SPEED_OF_LIGHT)
    return 2 * math.pi * float(cycles % 1)
