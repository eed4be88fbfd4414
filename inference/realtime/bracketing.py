"""Where to look next for a root between two points of opposite sign."""

import math

from simulator.compiled import compiled

__all__ = ["EPSILON", "next_point"]

EPSILON = 2.220446049250313e-16


@compiled
def next_point(
    a: float, b: float, c: float, fa: float, fb: float, fc: float
) -> tuple[float, float]:
    """Propose a point between a and b, by Chandrupatla's rule.

    Inverse quadratic interpolation where the three points say that the function is close enough to
    its parabola, else bisection: geometric while the ends differ by more than a factor of four, so
    that a root is found at any scale in a few steps.

    Parameters
    ----------
    a, fa : float
        The latest point and its value.
    b, fb : float
        The other end; fb has the opposite sign.
    c, fc : float
        The point before; c = b at the start, which asks for bisection.

    Returns
    -------
    (float, float)
        The point, and the width at which the bracket is as narrow as rounding allows.

    References
    ----------
    T. R. Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
    """
    low, high = min(a, b), max(a, b)
    tolerance = 2.0 * EPSILON * (a if abs(fa) < abs(fb) else b)
    if high > 4.0 * low and low > 0.0:
        return math.sqrt(low) * math.sqrt(high), tolerance
    share = 0.5
    if c != b:
        xi = (a - b) / (c - b)
        phi = (fa - fb) / (fc - fb)
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            share = fa / (fb - fa) * fc / (fb - fc)
            share += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    width = abs(b - a)
    least = 0.5 * tolerance / width if width > 0.0 else 0.5
    if least > 0.5:
        least = 0.5
    if not share > least:  # also where it is nan
        share = least
    share = min(share, 1.0 - least)
    return a + share * (b - a), tolerance
