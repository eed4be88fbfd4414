"""Triangular roots of covariances of two readings: nothing is ever subtracted."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = [
    "UNIT",
    "Root",
    "add_factor",
    "add_factors",
    "add_root",
    "in_units",
    "rest_of",
    "rotation",
    "slope_of",
    "solve",
    "times",
]

Array = NDArray[np.float64]

_LEAST_LENGTH = 1e-150  # below it squares come near the least number that has all its digits
_LEAST_SQUARE = 1e-290  # below it a square has not all its digits
_NONE = 1e-9  # of an information: less is none
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


@compiled
def in_units(root: Root, first: float, second: float) -> tuple[float, float]:
    """Return root^-1 times a vector."""
    own = first / root.r11
    return own, (second - root.r21 * own) / root.r22


@compiled
def rest_of(known: Root, held: Root) -> tuple[bool, Root]:
    """Return what is left to learn of what is known, where something else is held.

    Parameters
    ----------
    known, held : Root
        Of two covariances.

    Returns
    -------
    (bool, Root)
        Whether anything is, and the root of the covariance whose inverse is the first one's less
        the second one's, along the directions in which that is positive.
    """
    first, second = in_units(known, held.r11, held.r21)
    root = Root(first, second, held.r22 / known.r22)
    # eigenvalues and vectors of the second in units of the first
    v11, v12 = root.r11 * root.r11, root.r11 * root.r21
    v22 = root.r21 * root.r21 + root.r22 * root.r22
    large = 0.5 * (v11 + v22 + math.hypot(v11 - v22, 2.0 * v12))
    if not large > 1.0 + _NONE:
        return False, known
    small = root.r11 * root.r22
    small *= small / large
    angle = 0.5 * math.atan2(2.0 * v12, v11 - v22)
    cosine, sine = math.cos(angle), math.sin(angle)
    # of variance v: information 1 - 1/v
    most = 1.0 / math.sqrt(1.0 - 1.0 / large)
    least = 1.0 / math.sqrt(max(1.0 - 1.0 / max(small, 1.0), _NONE))
    rest = Root(0.0, 0.0, 0.0)
    for part, first, second in ((most, cosine, sine), (least, -sine, cosine)):
        own = part * known.r11 * first
        rest = add_factor(rest, own, part * (known.r21 * first + known.r22 * second))
    return True, rest


@compiled
def times(root: Root, vector: tuple[float, float]) -> tuple[float, float]:
    """Return root root^T times a vector."""
    along1 = root.r11 * vector[0] + root.r21 * vector[1]
    along2 = root.r22 * vector[1]
    return root.r11 * along1, root.r21 * along1 + root.r22 * along2
