"""Monotone intervals of a curve: the proof that every root is found, and found once.

A curve has at most one root in each interval between two neighbouring turning points (or poles).
Turning points are roots of polynomials of degree 2 to 4, of the differential phase for background
cancelling of a sine wave, and sign changes on a fine grid for the two curves of a derivative with
background (docs/model.md, exact).
"""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.bracketing import LEAST
from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import (
    Curve,
    CurveParameters,
    Level,
    Polynomial,
    Search,
)
from inference.realtime.solving.intervals import MonotoneIntervals
from inference.realtime.solving.invert import invert
from inference.realtime.solving.polynomials import real_roots
from inference.realtime.solving.reach import Span
from inference.realtime.solving.searching import DENOMINATOR, TURNING, search_grid, sign_changes
from simulator.compiled import compiled

__all__ = ["monotone_intervals"]

Array = NDArray[np.float64]


def monotone_intervals(
    curve: Curve, p: CurveParameters, low: float, high: float
) -> MonotoneIntervals:
    """Part an interval into those in which a curve is monotone.

    Parameters
    ----------
    curve : Curve
        The curve.
    p : CurveParameters
        Its parameters.
    low, high : float
        The interval, 0 <= low < high; an infinite end is moved to where the curve has vanished.

    Returns
    -------
    MonotoneIntervals
        They cover the interval.
    """
    low = max(low, LEAST)
    high = min(high, 1.0 / LEAST)
    turns, poles = _marks(curve, p, low, high)
    points = [low, *sorted({*turns, *poles} - {low, high}), high]
    if curve.winds:
        return _unwrapped(curve, p, points, turns)
    at = [_value(curve, u, p) for u in points]
    at_low, at_high = np.array(at[:-1]), np.array(at[1:])
    for i, (left, right) in enumerate(itertools.pairwise(points)):
        if left in poles or right in poles:
            inside, _ = dispatch.direction(curve.kind, math.sqrt(left) * math.sqrt(right), p)
            if left in poles:
                at_low[i] = _infinity(curve, left, p, inside)
            if right in poles:
                at_high[i] = _infinity(curve, right, p, inside)
    return _between(points, at_low, at_high, turns)


def _between(
    points: list[float], at_low: Array, at_high: Array, turns: list[float]
) -> MonotoneIntervals:
    low, high = np.array(points[:-1]), np.array(points[1:])
    return MonotoneIntervals(low, high, at_low, at_high, np.isin(low, turns), np.isin(high, turns))


def _value(curve: Curve, u: float, p: CurveParameters) -> float:
    """Evaluate exactly where a curve can: at a turning point that decides the count of roots."""
    return dispatch.value(curve.kind, u, p) if curve.exact is None else curve.exact(u, p)


def _infinity(curve: Curve, pole: float, p: CurveParameters, inside: float) -> float:
    """Return the infinity that a ratio goes to; ``inside`` is its denominator on that side."""
    _, numerator = dispatch.direction(curve.kind, pole, p)
    return math.copysign(math.inf, numerator * math.copysign(1.0, inside))


def _roots(polynomial: Polynomial, p: CurveParameters, low: float, high: float) -> list[float]:
    coefficients = polynomial.coefficients(p)
    found = np.empty(len(coefficients))
    count = real_roots(np.array(coefficients), low, high, found)
    return [float(root) for root in found[:count]]


def _marks(
    curve: Curve, p: CurveParameters, low: float, high: float
) -> tuple[list[float], list[float]]:
    """Return turning points and poles (docs/model.md, 4.1, 4.4, 4.68 and exact)."""
    turns: list[float] = []
    poles: list[float] = []
    if isinstance(curve.turns, Polynomial):
        turns = _roots(curve.turns, p, low, high)
    elif isinstance(curve.turns, Level):
        turns = _crossings(curve.turns, p, low, high)
    if isinstance(curve.poles, Polynomial):
        poles = _roots(curve.poles, p, low, high)
    if isinstance(curve.turns, Search) or isinstance(curve.poles, Search):
        grid = search_grid(p, low, high)
        if isinstance(curve.turns, Search):
            turns = sign_changes(TURNING, curve.kind, p, grid).tolist()
        if isinstance(curve.poles, Search):
            poles = sign_changes(DENOMINATOR, curve.kind, p, grid).tolist()
    return turns, poles


def _crossings(level: Level, p: CurveParameters, low: float, high: float) -> list[float]:
    """Return where another curve takes a value."""
    other = level.curve
    intervals = monotone_intervals(other, p, low, high)
    target = np.array([level.value(p)])
    exactly = Span(0.0, math.inf, 0.0)
    nothing = np.zeros((1, intervals.low.size, 2))
    roots, _, _, _, _ = invert(
        other.kind, p, intervals, other.period, target, np.ones(1), np.zeros(1), exactly, nothing
    )
    return [float(u) for u in roots.ravel() if math.isfinite(u)]


@compiled
def _three(
    kind: int, a: float, middle: float, b: float, p: CurveParameters
) -> tuple[float, float, float]:
    """Return the values at three points: one call, because calls cost more than values."""
    return dispatch.value(kind, a, p), dispatch.value(kind, middle, p), dispatch.value(kind, b, p)


def _unwrapped(
    curve: Curve, p: CurveParameters, points: list[float], turns: list[float]
) -> MonotoneIntervals:
    """Intervals of an angle: cut so finely that it turns by less than a right angle in each."""
    grid = [points[0]]
    for left, right in itertools.pairwise(points):
        stack = [(left, right, 0)]
        while stack:
            a, b, depth = stack.pop()
            middle = 0.5 * (a + b) if b < 4.0 * a else math.sqrt(a) * math.sqrt(b)
            first, second, third = _three(curve.kind, a, middle, b, p)
            one, other = _wrapped(second - first), _wrapped(third - second)
            wide = max(abs(one), abs(other)) > 0.24 * math.pi or one * other < 0.0
            if (wide or depth < 1) and depth < 60 and a < middle < b:
                stack += [(middle, b, depth + 1), (a, middle, depth + 1)]
            else:
                grid.append(b)
    angles = np.unwrap([dispatch.value(curve.kind, u, p) for u in grid])
    # the object's own derivative points away from its phase: modulo pi the branch starts at zero
    angles -= math.pi * round(angles[0] / math.pi)
    return _between(grid, angles[:-1], angles[1:], turns)


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
