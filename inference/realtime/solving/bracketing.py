"""Narrow a bracket of a root, by Chandrupatla's rule.

A loop around `next_point` and `narrowed` stands wherever a function is solved, because compiled
functions cannot be passed as arguments without giving up the cache of machine code::

    bracket = start(low, high, f(low), f(high))
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, f(x))
    root = best(bracket)
"""

import math
from typing import NamedTuple

from simulator.compiled import compiled

__all__ = ["EPSILON", "LEAST", "STEPS", "Bracket", "best", "narrowed", "next_point", "start"]

EPSILON = 2.220446049250313e-16
LEAST = 2.0**-330  # stands for zero range: its square is still a normal number
STEPS = 400  # geometric bisection of all doubles takes 11, plain bisection of one octave 53


class Bracket(NamedTuple):
    """Two points at which a function has opposite signs, and the point before.

    Attributes
    ----------
    latest, other, before : float
        The latest point, the other end, and the point before the latest.
    f_latest, f_other, f_before : float
        The function's values there.
    """

    latest: float
    other: float
    before: float
    f_latest: float
    f_other: float
    f_before: float


@compiled
def start(low: float, high: float, f_low: float, f_high: float) -> Bracket:
    """Return the bracket of an interval whose ends have values of opposite sign."""
    return Bracket(low, high, high, f_low, f_high, f_high)


@compiled
def next_point(bracket: Bracket) -> float:
    """Propose a point between a and b; nan where the bracket is as narrow as rounding allows.

    Inverse quadratic interpolation where the three points say that the function is close enough to
    its parabola, else bisection: geometric while the ends differ by more than a factor of four, so
    that a root is found at any scale in a few steps.

    References
    ----------
    T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
    """
    a, b, c, fa, fb, fc = bracket
    width = abs(b - a)
    tolerance = 2.0 * EPSILON * (a if abs(fa) < abs(fb) else b)
    if width <= tolerance or fa == 0.0 or fb == 0.0:
        return math.nan
    low, high = min(a, b), max(a, b)
    if high > 4.0 * low and low > 0.0:
        return math.sqrt(low) * math.sqrt(high)
    share = 0.5
    if c != b:
        xi = (a - b) / (c - b)
        phi = (fa - fb) / (fc - fb)
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            share = fa / (fb - fa) * fc / (fb - fc)
            share += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    least = min(0.5 * tolerance / width, 0.5)
    if not share > least:  # also where it is nan
        share = least
    return a + min(share, 1.0 - least) * (b - a)


@compiled
def narrowed(bracket: Bracket, x: float, fx: float) -> Bracket:
    """Return the part of a bracket that holds the root, x being its latest point."""
    a, b, fa, fb = bracket.latest, bracket.other, bracket.f_latest, bracket.f_other
    if (fx > 0.0) == (fa > 0.0):
        return Bracket(x, b, a, fx, fb, fa)
    return Bracket(x, a, b, fx, fa, fb)


@compiled
def best(bracket: Bracket) -> float:
    """Return the end with the smaller value."""
    return bracket.latest if abs(bracket.f_latest) < abs(bracket.f_other) else bracket.other
