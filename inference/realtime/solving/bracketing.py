"""Narrow a bracket of a root, by Chandrupatla's rule.

A bracket is (a, b, c, fa, fb, fc): the latest point a, the other end b, where the function has the
opposite sign, the point before c, and the values there. A loop around `next_point` and `narrowed`
stands wherever a function is solved, because compiled functions cannot be passed as arguments
without giving up the cache of machine code::

    bracket = start(low, high, f(low), f(high))
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, f(x))
    root = best(bracket)
"""

import math

from simulator.compiled import compiled

__all__ = ["EPSILON", "STEPS", "Bracket", "best", "narrowed", "next_point", "start"]

Bracket = tuple[float, float, float, float, float, float]

EPSILON = 2.220446049250313e-16
STEPS = 400  # geometric bisection of all doubles takes 11, plain bisection of one octave 53


@compiled
def start(low: float, high: float, f_low: float, f_high: float) -> Bracket:
    """Return the bracket of an interval whose ends have values of opposite sign."""
    return low, high, high, f_low, f_high, f_high


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
    a, b, _, fa, fb, _ = bracket
    if (fx > 0.0) == (fa > 0.0):
        return x, b, a, fx, fb, fa
    return x, a, b, fx, fa, fb


@compiled
def best(bracket: Bracket) -> float:
    """Return the end with the smaller value."""
    return bracket[0] if abs(bracket[3]) < abs(bracket[4]) else bracket[1]
