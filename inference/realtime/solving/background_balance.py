"""Background intensity of a pulse: r w2 + B S(r) (R - r) = r0 w1, a cubic (4.76)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from inference.realtime.solving.bracketing import (
    EPSILON,
    LEAST,
    STEPS,
    best,
    narrowed,
    next_point,
    start,
)
from inference.realtime.solving.known_background import Found, KnownBackground
from inference.realtime.solving.polynomials import fill, real_roots
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled

__all__ = ["solve_balance"]

Array = NDArray[np.float64]


class _ScaledFrame(NamedTuple):
    """A frame in units of its largest reading; w1 is already times r0, and so is its noise."""

    w1: float
    w2: float
    b: float
    v1: float
    v2: float
    v12: float


@compiled
def _frame(net: Net, i: int, strength: float, r0: float) -> _ScaledFrame:
    first, second = net.first[i], net.second[i]
    # so that nothing overflows
    size = max(abs(second), abs(first), strength)
    return _ScaledFrame(
        r0 * (first / size),
        second / size,
        strength / size,
        r0 * (r0 * (net.var1[i] / size / size)),
        net.var2[i] / size / size,
        r0 * (net.cov[i] / size / size),
    )


@compiled
def _balance(r: float, frame: _ScaledFrame, far: KnownBackground) -> float:
    """Return (r w2 - w1) + b S(r) (R - r)."""
    return (r * frame.w2 - frame.w1) + frame.b * shadow(r, far.c0, far.c1) * (far.distance - r)


@compiled
def _spread(r: float, frame: _ScaledFrame) -> float:
    """Return the standard deviation of r w2 - w1."""
    return math.sqrt(max(frame.v1 + r * r * frame.v2 - 2.0 * r * frame.v12, 0.0))


@compiled
def _between(low: float, high: float, frame: _ScaledFrame, far: KnownBackground) -> float:
    """Return the root between two points of opposite sign."""
    # Newton from the conventional range, which is the root where there is no background
    w1, w2, b = frame.w1, frame.w2, frame.b
    r = w1 / w2
    for _ in range(10):
        if not low < r < high:
            break
        q = r * (r + far.c1) + far.c0
        seen, left = b * (r * (r + far.c1) / q), far.distance - r
        steep = w2 - seen + b * (far.c0 / q) * ((2.0 * r + far.c1) / q) * left
        step = ((w1 - r * w2) - seen * left) / steep
        r += step
        if abs(step) < 1e-8 * r:  # what remains is its square; once more in the exact form
            r -= _balance(r, frame, far) / steep
            return float(min(max(r, low), high))
    bracket = start(low, high, _balance(low, frame, far), _balance(high, frame, far))
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, _balance(x, frame, far))
    return best(bracket)


@compiled
def _turns(frame: _ScaledFrame, far: KnownBackground, slope: Array, turns: Array) -> int:
    """Fill in the cubic's slope and where it turns before the background; return how often."""
    w1, w2, b = frame.w1, frame.w2, frame.b
    a2 = (w2 - b) * far.c1 - (w1 - b * far.distance)
    a1 = w2 * far.c0 - far.c1 * (w1 - b * far.distance)
    fill(slope, (3.0 * (w2 - b), 2.0 * a2, a1))
    return real_roots(slope, 0.0, far.distance, turns)


@compiled
def _error_bar(
    r: float, frame: _ScaledFrame, far: KnownBackground, band: float
) -> tuple[float, float, bool]:
    """Return a root's sd, its change by late light, and whether noise allows it to be physical."""
    slope = frame.b * shadow_slope(r, far.c0, far.c1)
    flux = frame.w2 - frame.b * shadow(r, far.c0, far.c1)
    steep = flux + slope * (far.distance - r)
    sd = _spread(r, frame) / abs(steep)
    # flux = w2 - b S(r), d r = (d w1 - r d w2) / steep
    lever = slope / steep
    g1, g2 = -lever, 1.0 + lever * r
    variance = g1 * (g1 * frame.v1) + g2 * (g2 * frame.v2) + 2.0 * g1 * g2 * frame.v12
    spread = math.sqrt(max(variance, 0.0))
    spread = band * spread + 64.0 * EPSILON * (abs(frame.w2) + frame.b) * (1.0 + abs(lever) * r)
    seen = r + far.c1 >= -(band * sd + 1e-12 * r)
    return sd, flux / steep, seen and not flux < -spread


@compiled
def solve_balance(net: Net, far: KnownBackground, r0: float, band: float, found: Found) -> None:
    """Find all roots of every frame, their standard deviations and whether they are physical.

    Parameters
    ----------
    net : Net
        Net readings of n frames; those of a state other than 0 are passed over.
    far : KnownBackground
        The background.
    r0 : float
        Range at which the whole pulse is late, in the background's unit.
    band : float
        Standard deviations that count as within the noise.
    found : Found
        Receives the results.
    """
    slope, turns, ends = np.empty(3), np.empty(3), np.empty(4)
    for i in range(net.first.size):
        if net.state[i] != 0:
            continue
        frame = _frame(net, i, far.strength, r0)
        count = _turns(frame, far, slope, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = far.distance
        roots = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left, right = _balance(low, frame, far), _balance(high, frame, far)
            # whether noise reaches the turning points at the ends
            near = j > 0 and abs(left) < band * _spread(low, frame)
            near |= j < count and abs(right) < band * _spread(high, frame)
            if near:
                found.near_frame[i] = True
            if not ((left < 0.0 <= right) or (left > 0.0 >= right)):
                continue
            r = _between(low, high, frame, far)
            if not r < far.distance or (roots > 0 and r <= found.roots[i, roots - 1]):
                continue
            found.roots[i, roots] = r
            found.near[i, roots] = near
            sd, late, physical = _error_bar(r, frame, far, band)
            found.sds[i, roots], found.late[i, roots] = sd, late
            found.physical[i, roots] = physical
            roots += 1
