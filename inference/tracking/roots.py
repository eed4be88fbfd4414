"""Triangular roots of covariances of two readings: nothing is ever subtracted."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["UNIT", "Root", "add_factor", "add_factors", "add_root", "rotation", "slope_of", "solve"]

Array = NDArray[np.float64]

_LEAST_LENGTH = 1e-150  # below it squares come near the least number that has all its digits
_LEAST_SQUARE = 1e-290  # below it a square has not all its digits
_SCALE = 2.0**600  # by which the least number of all is far from it


class Root(NamedTuple):
    """Lower triangular root of a covariance of two numbers, by its elements."""

    r11: float
    r21: float
    r22: float


UNIT = Root(1.0, 0.0, 1.0)
"""Of independent numbers in units of their noise."""


@compiled
def rotation(first: float, second: float) -> tuple[float, float, float]:
    """Return the length of a vector, and cosine and sine of its angle; right also where it is tiny.

    The vector must not be zero.
    """
    length = math.sqrt(first * first + second * second)
    if length > _LEAST_LENGTH:
        return length, first / length, second / length
    first, second = first * _SCALE, second * _SCALE
    length = math.sqrt(first * first + second * second)
    return length / _SCALE, first / length, second / length


@compiled
def add_factor(root: Root, first: float, second: float) -> Root:
    """Return the triangular root of root root^T + f f^T, by one rotation: nothing cancels.

    Parameters
    ----------
    root : Root
        Lower triangular.
    first, second : float
        The vector f.
    """
    if first == 0.0:
        if second == 0.0:
            return root
        return Root(root.r11, root.r21, math.sqrt(root.r22 * root.r22 + second * second))
    length, cosine, sine = rotation(root.r11, first)
    rest = cosine * second - sine * root.r21
    return Root(
        length, cosine * root.r21 + sine * second, math.sqrt(root.r22 * root.r22 + rest * rest)
    )


@compiled
def slope_of(product: float, square: float) -> float:
    """Return what a row has of another, from their product and the other's square; 0 of nothing."""
    return product / square if square > _LEAST_SQUARE else 0.0


@compiled
def add_factors(root: Root, factors: Array, first: int) -> Root:
    """Return the triangular root of root root^T + F F^T, F the columns from ``first`` on.

    In two passes over F, shape (2, m), one row after the other, as by Gram and Schmidt: of two rows
    that is as near as by a rotation for every column, none of which has to wait for the one before.
    """
    if first == factors.shape[1]:
        return root
    square, product = root.r11 * root.r11, root.r11 * root.r21
    for j in range(first, factors.shape[1]):
        square += factors[0, j] * factors[0, j]
        product += factors[0, j] * factors[1, j]
    ratio = slope_of(product, square)
    off = root.r21 - ratio * root.r11
    rest = root.r22 * root.r22 + off * off
    for j in range(first, factors.shape[1]):
        off = factors[1, j] - ratio * factors[0, j]
        rest += off * off
    length = math.sqrt(square)
    return Root(length, ratio * length, math.sqrt(rest))


@compiled
def add_root(root: Root, more: Root) -> Root:
    """Return the triangular root of the sum of two covariances."""
    root = add_factor(root, more.r11, more.r21)
    return add_factor(root, 0.0, more.r22)


@compiled
def solve(root: Root, first: float, second: float) -> tuple[float, float]:
    """Return (root root^T)^-1 times a vector."""
    z1 = first / root.r11
    z2 = (second - root.r21 * z1) / root.r22
    y2 = z2 / root.r22
    return (z1 - root.r21 * y2) / root.r11, y2
