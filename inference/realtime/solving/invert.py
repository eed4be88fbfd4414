"""Invert a curve for many frames: every root in every monotone piece."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.curves import BOTH_PHASE, slope, solve_between
from simulator.compiled import compiled

__all__ = ["invert"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@compiled
def _capacity(values: Array, period: float) -> int:
    """Return the largest possible number of roots of one frame."""
    total = 0
    for j in range(values.shape[0]):
        total += 1
        if period > 0.0:
            total += int(abs(values[j, 1] - values[j, 0]) / period)
    return max(total, 1)


@compiled
def invert(
    kind: int,
    top: Array,
    bottom: Array,
    p: Array,
    ends: Array,
    values: Array,
    folds: Flags,
    period: float,
) -> tuple[Array, Array, Array, Array]:
    """Find all roots of value(u) = top / bottom.

    Parameters
    ----------
    kind : int
        The curve.
    top, bottom : ndarray, shape (n,)
        Targets; nan in ``top`` stands for a frame without a target.
    p : ndarray
        Parameters of the curve.
    ends, values, folds : ndarray, shape (k, 2)
        Its monotone pieces.
    period : float
        The target is known modulo this number; 0 if it is not an angle.

    Returns
    -------
    roots : ndarray, shape (n, m)
        nan-padded, in the order in which they are found.
    slopes : ndarray, shape (n, m)
        d value / du at the roots.
    gaps : ndarray, shape (n, m)
        Distance of the target from the nearer turning value of the root's piece, inf without.
    nearest : ndarray, shape (n,)
        Distance of the target from the nearest turning value of all.
    """
    n, k = top.size, ends.shape[0]
    m = _capacity(values, period)
    roots = np.full((n, m), np.nan)
    slopes = np.full((n, m), np.nan)
    gaps = np.full((n, m), np.inf)
    nearest = np.full(n, np.inf)
    for i in range(n):
        if not math.isfinite(top[i]):
            continue
        found = 0
        last = -1.0
        target = top[i] / bottom[i] if bottom[i] != 0.0 else math.inf
        for j in range(k):
            below, above = min(values[j, 0], values[j, 1]), max(values[j, 0], values[j, 1])
            goal = target
            if period > 0.0:
                goal = target + period * math.ceil((below - target) / period)
                for side in range(2):
                    if folds[j, side]:
                        off = (values[j, side] - target) / period
                        nearest[i] = min(nearest[i], period * abs(off - math.floor(off + 0.5)))
            else:
                for side in range(2):
                    if folds[j, side]:
                        nearest[i] = min(nearest[i], abs(values[j, side] - target))
            while below <= goal <= above and found < m:
                if bottom[i] == 0.0:  # the pole itself
                    u = ends[j, 0] if values[j, 0] == math.inf else ends[j, 1]
                elif period > 0.0 or kind == BOTH_PHASE:
                    u = solve_between(kind, ends[j, 0], ends[j, 1], goal, 1.0, p)
                else:
                    u = solve_between(kind, ends[j, 0], ends[j, 1], top[i], bottom[i], p)
                # neighbouring pieces share their end, where a double root is one root; but two
                # roots that rounding cannot tell apart stay two
                if goal != values[j, 0] or abs(u - last) > 4e-16 * u:
                    roots[i, found] = u
                    slopes[i, found] = slope(kind, u, p)
                    for side in range(2):
                        if folds[j, side]:
                            gaps[i, found] = min(gaps[i, found], abs(values[j, side] - goal))
                    found += 1
                    last = u
                if period <= 0.0:
                    break
                goal += period
    return roots, slopes, gaps, nearest
