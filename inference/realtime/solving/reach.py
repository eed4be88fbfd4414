"""How far noise moves a root: along the curve, where its tangent does not hold.

A standard deviation of first order follows the tangent. Where light drowns, the curve is so bent
within the noise that the tangent is wrong by many standard deviations: a reading of three of its
standard deviations is also that of an object at any farther range (docs/model.md, reach).
"""

import math
from typing import NamedTuple

from inference.realtime.solving.curves.curve import CurveParameters
from inference.realtime.solving.intervals import MonotoneIntervals
from inference.realtime.solving.newton import solve_between
from simulator.compiled import compiled

__all__ = ["Span", "reach_of"]

# below this share of the range, and beyond so many standard deviations from a turning value, the
# curve's move and the tangent's differ by a few percent
_SMALL = 0.005
_FAR_FROM_TURNS = 12.0


class Span(NamedTuple):
    """Ranges that the scene and the technique allow, and how far noise is followed.

    Attributes
    ----------
    low, high : float
        The ranges [the curve's unit of length]; ``high`` may be infinite.
    band : float
        Standard deviations of the target; 0 where none is asked for.
    end_band : float
        Those within which a target beyond the curve's last value is that of an object at its end.
    """

    low: float
    high: float
    band: float
    end_band: float = 0.0


@compiled
def _moved(
    kind: int, p: CurveParameters, intervals: MonotoneIntervals, j: int, aim: float, up: bool
) -> float:
    """Return where the curve takes a value on one side of interval j; an end where it does not."""
    step = 1 if up else -1
    last = intervals.low.size - 1 if up else 0
    while True:
        at_low, at_high = intervals.at_low[j], intervals.at_high[j]
        if min(at_low, at_high) <= aim <= max(at_low, at_high):
            found: float = solve_between(kind, intervals.low[j], intervals.high[j], aim, 1.0, p)
            return found
        turns = intervals.turns_high[j] if up else intervals.turns_low[j]
        if turns:
            return float(intervals.high[j] if up else intervals.low[j])
        if j == last:
            return math.inf if up else 0.0
        j += step


@compiled
def reach_of(
    kind: int,
    p: CurveParameters,
    intervals: MonotoneIntervals,
    j: int,
    root: tuple[float, float, float, float],
    sd: float,
    span: Span,
) -> float:
    """Return the larger of the moves of a root by ``span.band`` standard deviations, over these.

    Parameters
    ----------
    kind, p, intervals
        The curve.
    j : int
        The interval of the root.
    root : (float, float, float, float)
        Where it is, the curve's value and slope there, and the value's distance from the nearer
        turning value.
    sd : float
        Standard deviation of the value.
    span : Span
        Where ranges end, and the standard deviations that are followed.

    Returns
    -------
    float
        A standard deviation of the root [unit of length]: infinite where noise reaches no end, 0
        where the tangent is as good.
    """
    u, goal, slope, gap = root
    if not (span.band > 0.0 and sd > 0.0):
        return 0.0
    if sd <= _SMALL * abs(slope) * u and gap >= _FAR_FROM_TURNS * sd:
        return 0.0
    most = 0.0
    for side in (-1.0, 1.0):
        aim = goal + side * span.band * sd
        up = (intervals.at_high[j] > intervals.at_low[j]) == (side > 0.0)
        moved = min(max(_moved(kind, p, intervals, j, aim, up), span.low), span.high)
        most = max(most, abs(moved - u))
    return most / span.band
