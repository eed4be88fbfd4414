"""Roots of an analytic function, counted by ball arithmetic: no rounding can hide one or add one.

An interval is parted until the function or its slope, enclosed over a part, excludes zero. Where
neither ever does, the function has a double root to within 2^-200, and nothing is said.
"""

from collections.abc import Callable

from flint import arb, arb_series, ctx

__all__ = ["BITS", "Function", "exact", "roots_of"]

BITS = 320
_DEEPEST = 200  # halvings

Function = Callable[[arb_series], arb_series]


def exact(x: float) -> arb:
    """Return a binary number as a ball of no radius."""
    mantissa, exponent = float(x).as_integer_ratio()
    return arb(mantissa) / exponent  # a power of two: nothing is rounded


def _at(g: Function, x: arb) -> tuple[arb, arb]:
    y = g(arb_series([x, 1], prec=2))
    return y[0], y[1]


def _hull(a: arb, b: arb) -> arb:
    return a.union(b)


def roots_of(g: Function, high: arb) -> list[arb] | None:
    """Enclose every root in (0, high); None where two cannot be told apart or from none.

    Parameters
    ----------
    g : callable
        From a power series to a power series, not zero at zero.
    high : arb
        A point.
    """
    ctx.prec = BITS
    low = high
    for _ in range(60):
        low = low / 2**20
        if not _at(g, _hull(arb(0), low))[0].contains(0):
            break
    else:
        return None
    found: list[arb] = []
    parts = [(low.mid(), high.mid(), 0)]
    while parts:
        a, b, depth = parts.pop()
        x = _hull(a, b)
        value, slope = _at(g, x)
        if not value.contains(0):
            continue
        middle = ((a + b) / 2 if b < 4 * a else (a * b).sqrt()).mid()
        if not slope.contains(0):
            left, right = _at(g, a)[0], _at(g, b)[0]
            if left.contains(0) or right.contains(0):
                return None
            if (left > 0) != (right > 0):
                found.append(_narrowed(g, a, b, left > 0))
            continue
        # the mean value form is sharper in small parts
        if b < 2 * a and not (_at(g, middle)[0] + slope * (x - middle)).contains(0):
            continue
        if depth == _DEEPEST:
            return None
        parts += [(middle, b, depth + 1), (a, middle, depth + 1)]
    return found


def _narrowed(g: Function, a: arb, b: arb, positive: bool) -> arb:
    """Bisect the one root between two points."""
    for _ in range(160):
        middle = ((a + b) / 2).mid()
        value = _at(g, middle)[0]
        if value.contains(0):
            break
        if (value > 0) == positive:
            a = middle
        else:
            b = middle
    return _hull(a, b)
