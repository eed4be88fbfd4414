"""Background intensity of a pulse: r w2 + B S(r) (R - r) = r0 w1, a cubic (4.76)."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.bracketing import EPSILON, STEPS, best, narrowed, next_point, start
from inference.realtime.solving.monotone_intervals import LEAST
from inference.realtime.solving.polynomials import real_roots
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled

__all__ = ["solve_balance"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@compiled
def _balance(r: float, w1: float, w2: float, b: float, p: Array) -> float:
    """Return (r w2 - w1) + b S(r) (R - r); w1 is already times r0. p = (R, c0', c1', k)."""
    return (r * w2 - w1) + b * shadow(r, p[1], p[2]) * (float(p[0]) - r)


@compiled
def _between(low: float, high: float, w1: float, w2: float, b: float, p: Array) -> float:
    # Newton from the conventional range, which is the root where there is no background
    r = w1 / w2
    for _ in range(10):
        if not low < r < high:
            break
        q = r * (r + p[2]) + p[1]
        seen, left = b * (r * (r + p[2]) / q), p[0] - r
        steep = w2 - seen + b * (p[1] / q) * ((2.0 * r + p[2]) / q) * left
        step = ((w1 - r * w2) - seen * left) / steep
        r += step
        if abs(step) < 1e-8 * r:  # what remains is its square; once more in the exact form
            r -= _balance(r, w1, w2, b, p) / steep
            return float(min(max(r, low), high))
    bracket = start(low, high, _balance(low, w1, w2, b, p), _balance(high, w1, w2, b, p))
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, _balance(x, w1, w2, b, p))
    return best(bracket)


@compiled
def solve_balance(
    first: Array,
    second: Array,
    var1: Array,
    var2: Array,
    cov: Array,
    state: NDArray[np.uint8],
    strength: float,
    r0: float,
    p: Array,
    band: float,
    roots: Array,
    sds: Array,
    near: Flags,
    near_frame: Flags,
    physical: Flags,
) -> None:
    """Find all roots of every frame, their standard deviations and whether they are physical.

    Parameters
    ----------
    first, second, var1, var2, cov : ndarray, shape (n,)
        Net readings and their covariance.
    state : ndarray of uint8, shape (n,)
        Frames other than 0 are passed over.
    strength : float
        Reading of the bare background.
    r0 : float
        Range at which the whole pulse is late, in the unit of ``p``.
    p : ndarray, shape (4,)
        R, c0', c1' and wave number, in one unit of length.
    band : float
        Standard deviations that count as within the noise.
    roots, sds, near, near_frame, physical
        Results, see `Candidates`; filled from the left.
    """
    distance, c0, c1 = p[0], p[1], p[2]
    cubic, turns, ends = np.empty(3), np.empty(3), np.empty(4)
    for i in range(first.size):
        if state[i] != 0:
            continue
        # in units of the largest, so that nothing overflows
        size = max(abs(second[i]), abs(first[i]), strength)
        w1, w2, b = r0 * (first[i] / size), second[i] / size, strength / size
        v1 = r0 * (r0 * (var1[i] / size / size))
        v2 = var2[i] / size / size
        v12 = r0 * (cov[i] / size / size)
        a2 = (w2 - b) * c1 - (w1 - b * distance)
        a1 = w2 * c0 - c1 * (w1 - b * distance)
        cubic[0], cubic[1], cubic[2] = 3.0 * (w2 - b), 2.0 * a2, a1
        count = real_roots(cubic, 0.0, distance, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = distance
        found = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left, right = _balance(low, w1, w2, b, p), _balance(high, w1, w2, b, p)
            for side in range(2):
                at, off = (low, left) if side == 0 else (high, right)
                if (side == 0 and j > 0) or (side == 1 and j < count):
                    spread = math.sqrt(max(v1 + at * at * v2 - 2.0 * at * v12, 0.0))
                    if abs(off) < band * spread:
                        near_frame[i] = True
                        near[i, j] = True
            if not ((left < 0.0 <= right) or (left > 0.0 >= right)):
                continue
            r = _between(low, high, w1, w2, b, p)
            if not r < distance or (found > 0 and r <= roots[i, found - 1]):
                continue
            roots[i, found] = r
            near[i, found] = near[i, j]
            slope = b * shadow_slope(r, c0, c1)
            flux = w2 - b * shadow(r, c0, c1)
            steep = flux + slope * (distance - r)
            sds[i, found] = math.sqrt(max(v1 + r * r * v2 - 2.0 * r * v12, 0.0)) / abs(steep)
            # flux = w2 - b S(r), d r = (d w1 - r d w2) / steep
            lever = slope / steep
            g1, g2 = -lever, 1.0 + lever * r
            spread = math.sqrt(max(g1 * (g1 * v1) + g2 * (g2 * v2) + 2.0 * g1 * g2 * v12, 0.0))
            spread = band * spread + 64.0 * EPSILON * (abs(w2) + b) * (1.0 + abs(lever) * r)
            seen = r + c1 >= -(band * sds[i, found] + 1e-12 * r)
            physical[i, found] = seen and not flux < -spread
            found += 1
        for j in range(found, near.shape[1]):
            near[i, j] = False
