"""Invert a curve for many frames: every root in every monotone interval."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.curves import dispatch
from inference.realtime.solving.curves.curve import CurveParameters
from inference.realtime.solving.intervals import MonotoneIntervals
from inference.realtime.solving.newton import solve_between
from inference.realtime.solving.reach import Span, reach_of
from simulator.compiled import compiled

__all__ = ["invert"]

Array = NDArray[np.float64]


@compiled
def _capacity(intervals: MonotoneIntervals, period: float) -> int:
    """Return the largest possible number of roots, folds and ends of one frame."""
    total = int(intervals.low.size > 1)
    for j in range(intervals.low.size):
        total += 1 + int(_own_fold(intervals, j)) + int(intervals.turns_high[j])
        if period > 0.0:
            total += int(abs(intervals.at_high[j] - intervals.at_low[j]) / period)
    return max(total, 1)


@compiled
def _own_fold(intervals: MonotoneIntervals, j: int) -> bool:
    """Say whether the curve turns at the lower end of interval j, and no other ends there."""
    if not intervals.turns_low[j]:
        return False
    return j == 0 or intervals.high[j - 1] != intervals.low[j] or not intervals.turns_high[j - 1]


@compiled
def _beyond(turn: float, other: float, target: float, period: float) -> float:
    """Return by how much a target lies beyond a turning value, where no root is; else less."""
    beyond = target - turn
    if period > 0.0:
        beyond -= period * math.floor(beyond / period + 0.5)
    return beyond if turn > other else -beyond


@compiled
def _off(value: float, target: float, period: float) -> float:
    """Return the distance of a value from a target, which may be known modulo a period."""
    if period > 0.0:
        turns = (value - target) / period
        return period * abs(turns - math.floor(turns + 0.5))
    return abs(value - target)


@compiled
def invert(
    kind: int,
    p: CurveParameters,
    intervals: MonotoneIntervals,
    period: float,
    top: Array,
    bottom: Array,
    sd: Array,
    span: Span,
    errors: Array,
) -> tuple[Array, Array, Array, Array, Array]:
    """Find all roots of value(u) = top / bottom, and where errors may have taken others away.

    Errors merge a pair of roots at a fold, and move one beyond the end of the last interval. These
    places are listed among the roots: an end only beside a root, which it is not the only one of.

    Parameters
    ----------
    kind : int
        The curve.
    p : CurveParameters
        Its parameters.
    intervals : MonotoneIntervals
        Its monotone intervals.
    period : float
        The target is known modulo this number; 0 if it is not an angle.
    top, bottom : ndarray, shape (n,)
        Targets; nan in ``top`` stands for a frame without a target.
    sd : ndarray, shape (n,)
        Their standard deviations; nan where there is none.
    span : Span
        Where ranges end, and how far noise is followed along the curve.
    errors : ndarray, shape (n or 1, k, 2)
        Standard deviations of the values at both ends of the intervals by errors of the model.

    Returns
    -------
    roots : ndarray, shape (n, m)
        nan-padded, in the order in which they are found.
    slopes : ndarray, shape (n, m)
        d value / du at the roots; 0 at a fold that the target misses by less than ``span.band``,
        and at an end that it misses by less than ``span.end_band``.
    gaps : ndarray, shape (n, m)
        Distance of the target from the nearer turning value of the root's interval, inf without.
    nearest : ndarray, shape (n,)
        Distance of the target from the nearest turning value of all.
    reaches : ndarray, shape (n, m)
        Standard deviations of the roots along the curve (`reach_of`), 0 where the tangent holds.
    """
    n, k = top.size, intervals.low.size
    m = _capacity(intervals, period)
    roots = np.full((n, m), np.nan)
    slopes = np.full((n, m), np.nan)
    gaps = np.full((n, m), np.inf)
    nearest = np.full(n, np.inf)
    reaches = np.zeros((n, m))
    for i in range(n):
        if not math.isfinite(top[i]):
            continue
        found = 0
        last = -1.0
        target = top[i] / bottom[i] if bottom[i] != 0.0 else math.inf
        row = min(i, errors.shape[0] - 1)
        for j in range(k):
            low, high = intervals.low[j], intervals.high[j]
            at_low, at_high = intervals.at_low[j], intervals.at_high[j]
            below, above = min(at_low, at_high), max(at_low, at_high)
            by_low, by_high = (
                math.hypot(sd[i], errors[row, j, 0]),
                math.hypot(sd[i], errors[row, j, 1]),
            )
            if intervals.turns_low[j]:
                nearest[i] = min(nearest[i], _off(at_low, target, period))
                beyond = _beyond(at_low, at_high, target, period)
                if 0.0 < beyond < span.band * by_low and _own_fold(intervals, j) and found < m:
                    roots[i, found], slopes[i, found], gaps[i, found] = low, 0.0, 0.0
                    found += 1
            goal = target
            if period > 0.0:
                goal = target + period * math.ceil((below - target) / period)
            while below <= goal <= above and found < m:
                if bottom[i] == 0.0:  # the pole itself
                    u = low if at_low == math.inf else high
                elif period > 0.0:
                    u = solve_between(kind, low, high, goal, 1.0, p)
                else:
                    u = solve_between(kind, low, high, top[i], bottom[i], p)
                # neighbouring intervals share their end, where a double root is one root; but two
                # roots that rounding cannot tell apart stay two
                if goal != at_low or abs(u - last) > 4e-16 * u:
                    roots[i, found] = u
                    slopes[i, found] = dispatch.slope(kind, u, p)
                    if intervals.turns_low[j]:
                        gaps[i, found] = min(gaps[i, found], abs(at_low - goal))
                    if intervals.turns_high[j]:
                        gaps[i, found] = min(gaps[i, found], abs(at_high - goal))
                    if bottom[i] != 0.0:
                        root = (u, goal, slopes[i, found], gaps[i, found])
                        reaches[i, found] = reach_of(kind, p, intervals, j, root, sd[i], span)
                    found += 1
                    last = u
                if period <= 0.0:
                    break
                goal += period
            if intervals.turns_high[j]:
                nearest[i] = min(nearest[i], _off(at_high, target, period))
                beyond = _beyond(at_high, at_low, target, period)
                if 0.0 < beyond < span.band * by_high and found < m:
                    roots[i, found], slopes[i, found], gaps[i, found] = high, 0.0, 0.0
                    found += 1
        # last is a root's place: there is one
        if last > 0.0 and k > 1 and not intervals.turns_high[k - 1] and found < m:
            at_end = intervals.at_high[k - 1]
            beyond = _beyond(at_end, intervals.at_low[k - 1], target, period)
            by_end = math.hypot(sd[i], errors[row, k - 1, 1])
            if 0.0 < beyond < span.end_band * by_end:
                roots[i, found], slopes[i, found] = intervals.high[k - 1], 0.0
                gaps[i, found] = 0.0
                found += 1
    return roots, slopes, gaps, nearest, reaches
