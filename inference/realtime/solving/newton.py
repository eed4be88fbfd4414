"""The root of a curve between two points: Newton in logarithms, else a bracket."""

import math

from inference.realtime.solving.bracketing import (
    EPSILON,
    STEPS,
    best,
    narrowed,
    next_point,
    start,
)
from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import CurveParameters
from simulator.compiled import compiled

__all__ = ["solve_between"]


@compiled
def _newton(
    kind: int, low: float, high: float, top: float, bottom: float, p: CurveParameters
) -> float:
    """Solve by Newton in logarithms; nan where that leaves the interval or the sign.

    A power law, which most curves are near both ends, is solved in one step.
    """
    target = top / bottom
    u = dispatch.guess(kind, top, bottom, p)
    before = 1e-8
    for _ in range(12):
        if not low < u < high:
            return math.nan
        height, power = dispatch.power_law(kind, u, p)
        ratio = height / target
        if not ratio > 0.0:
            return math.nan
        step = -math.log(ratio) / power
        if not abs(step) < 2.0:
            return math.nan
        size = abs(step)
        # what remains is its square, times what made it of the step before: by a fold, and over
        # many turns of a phase, that is much; where steps stall they are rounding
        if size < 3e-8 and (size * size * size < EPSILON * before * before or size > 0.5 * before):
            return min(max(u * (1.0 + step), low), high)
        before = size
        u *= 1.0 + step + 0.5 * step * step if abs(step) < 0.02 else math.exp(step)
    return math.nan


@compiled
def solve_between(
    kind: int, low: float, high: float, top: float, bottom: float, p: CurveParameters
) -> float:
    """Return the u between two points at which a curve monotone between them takes a value.

    Parameters
    ----------
    kind : int
        The curve.
    low, high : float
        Ends, 0 < low < high; the value must lie between those at the ends.
    top, bottom : float
        The value is top / bottom; bottom = 1 but for ratios.
    p : CurveParameters
        Parameters.
    """
    root = _newton(kind, low, high, top, bottom, p)
    if root == root:
        return root
    f_low = dispatch.residual(kind, low, top, bottom, p)
    f_high = dispatch.residual(kind, high, top, bottom, p)
    if f_low == 0.0 or (f_low > 0.0) == (f_high > 0.0):
        # rounding at an end: the nearer one is the root
        return low if abs(f_low) <= abs(f_high) else high
    bracket = start(low, high, f_low, f_high)
    x = dispatch.guess(kind, top, bottom, p)
    if low < x < high:
        # the guess and a point a factor of two beyond the root are a bracket in most cases
        fx = dispatch.residual(kind, x, top, bottom, p)
        if (fx > 0.0) == (f_low > 0.0):
            bracket = start(x, high, fx, f_high)
            x *= 2.0
        else:
            bracket = start(low, x, f_low, fx)
            x *= 0.5
        if low < x < high:
            bracket = narrowed(bracket, x, dispatch.residual(kind, x, top, bottom, p))
            bracket = start(bracket.latest, bracket.other, bracket.f_latest, bracket.f_other)
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, dispatch.residual(kind, x, top, bottom, p))
    return best(bracket)
