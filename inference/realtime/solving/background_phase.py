"""Background intensity of a sine wave: what the background leaves has the phase of the range.

x - B S(r) e^jkR is the object alone, so theta(r) = k r - arg(x - B S e^jkR) is a multiple of 2 pi.
B S moves along a straight line, so that arg is monotone in S, and theta turns where a quartic has
its roots: between them every multiple of pi is met once.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.bracketing import EPSILON, STEPS, best, narrowed, next_point, start
from inference.realtime.solving.monotone_intervals import LEAST
from inference.realtime.solving.polynomials import real_roots
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled

__all__ = ["solve_phase"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Line = tuple[float, float, float, float, float]


@compiled
def _theta(r: float, line: Line, p: Array) -> float:
    """Return k r - psi - arg(mu - nu S e^j chi)."""
    psi, mu, nu, cosine, sine = line
    hidden = nu * shadow(r, p[1], p[2])
    return float(p[3]) * r - psi - math.atan2(-hidden * sine, mu - hidden * cosine)


@compiled
def _between(low: float, high: float, goal: float, line: Line, p: Array) -> float:
    psi, mu, nu, cosine, sine = line
    # Newton from the range of an object alone
    r = (goal + psi) / p[3]
    for _ in range(10):
        if not low < r < high:
            break
        q = r * (r + p[2]) + p[1]
        hidden = nu * (r * (r + p[2]) / q)
        x, y = mu - hidden * cosine, -hidden * sine
        steep = p[3] + mu * nu * sine * ((p[1] / q) * ((2.0 * r + p[2]) / q)) / (x * x + y * y)
        step = (goal - (p[3] * r - psi - math.atan2(y, x))) / steep
        r += step
        if abs(step) < 1e-8 * r:  # what remains is its square
            r += (goal - _theta(r, line, p)) / steep
            return float(min(max(r, low), high))
    f_low, f_high = _theta(low, line, p) - goal, _theta(high, line, p) - goal
    if (f_low > 0.0) == (f_high > 0.0):  # rounding at an end
        return low if abs(f_low) < abs(f_high) else high
    bracket = start(low, high, f_low, f_high)
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, _theta(x, line, p) - goal)
    return best(bracket)


@compiled
def _distance_to(
    r: float, x: float, y: float, b: float, far_cos: float, far_sin: float, p: Array
) -> float:
    """Return abs(x - B S(r) e^jkR), which turns an angle into a reading."""
    hidden = b * shadow(r, p[1], p[2])
    return math.hypot(x - hidden * far_cos, y - hidden * far_sin)


@compiled
def solve_phase(
    first: Array,
    second: Array,
    var1: Array,
    var2: Array,
    cov: Array,
    state: NDArray[np.uint8],
    strength: float,
    offset: float,
    far_phase: float,
    p: Array,
    band: float,
    roots: Array,
    sds: Array,
    near: Flags,
    near_frame: Flags,
    physical: Flags,
) -> None:
    """Find all roots of every frame with an object that is not negative beyond noise.

    Parameters
    ----------
    first, second, var1, var2, cov : ndarray, shape (n,)
        Net readings and their covariance.
    state : ndarray of uint8, shape (n,)
        Frames other than 0 are passed over.
    strength : float
        Reading of the bare background.
    offset, far_phase : float
        Phase offset, and k R reduced exactly [rad].
    p : ndarray, shape (4,)
        R, c0', c1' and wave number, in one unit of length.
    band : float
        Standard deviations that count as within the noise.
    roots, sds, near, near_frame, physical
        Results, see `Candidates`; filled from the left.
    """
    distance, c0, c1, k = p[0], p[1], p[2], p[3]
    far_cos, far_sin = math.cos(far_phase + offset), math.sin(far_phase + offset)
    quartic, turns, ends = np.empty(5), np.empty(5), np.empty(6)
    for i in range(first.size):
        largest = max(abs(first[i]), abs(second[i]))
        if state[i] != 0 or largest == 0.0:
            continue
        size = max(largest, strength)
        x, y, b = first[i] / size, second[i] / size, strength / size
        v1, v2, v12 = var1[i] / size / size, var2[i] / size / size, cov[i] / size / size
        rho = largest / size * math.hypot(first[i] / largest, second[i] / largest)
        psi = (math.atan2(y, x) - offset) % (2.0 * math.pi)
        # e^j chi, chi = k R - psi, and sin^2(chi / 2) without cancellation
        cosine, sine = (far_cos * x + far_sin * y) / rho, (far_sin * x - far_cos * y) / rho
        half = 0.5 * sine * sine / (1.0 + cosine) if cosine > 0.0 else 0.5 * (1.0 - cosine)
        # x - B S e^jkR is mu - nu S e^j chi as seen from x
        mu, nu = rho, b
        top = max(mu, nu)
        mu, nu = mu / top, nu / top
        line = (psi, mu, nu, cosine, sine)
        whole = (mu - nu) * (mu - nu) + 4.0 * mu * nu * half
        real = mu * ((mu - nu) + 2.0 * nu * half)
        twist = mu * nu * sine
        quartic[0] = k * whole
        quartic[1] = 2.0 * k * whole * c1
        quartic[2] = k * (whole * c1 * c1 + 2.0 * real * c0)
        quartic[3] = 2.0 * c0 * (k * real * c1 + twist)
        quartic[4] = c0 * (k * mu * mu * c0 + twist * c1)
        # with twist >= 0 theta can only turn where 2 r + c1' < 0, if the twist is strong enough
        least = mu * c0 - 0.25 * c1 * c1 * math.sqrt(whole)
        count = 0
        if twist < 0.0 or not (least > 0.0 and k * least * least > -twist * c0 * min(c1, 0.0)):
            count = real_roots(quartic, 0.0, distance, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = distance
        found = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left = _theta(low, line, p)
            right = _theta(high, line, p)
            below, above = min(left, right), max(left, right)
            first_turn = math.ceil(below / math.pi)
            last_turn = math.floor(above / math.pi)
            turn_count = int(last_turn - first_turn) + 1
            for step in range(turn_count):
                turn = first_turn + step if left < right else last_turn - step
                goal = turn * math.pi
                r = _between(low, high, goal, line, p)
                if not 0.0 < r < distance or (found > 0 and r <= roots[i, found - 1]):
                    continue
                if found == roots.shape[1]:
                    continue
                hidden = b * shadow(r, c0, c1)
                slope = b * shadow_slope(r, c0, c1)
                # the object's own direction, and the background's as seen from it
                cs, sn = x - hidden * far_cos, y - hidden * far_sin
                length = math.hypot(cs, sn)
                if length > 0.0:
                    sign = 1.0 if turn % 2.0 == 0.0 else -1.0
                    cs, sn = sign * cs / length, sign * sn / length
                else:
                    cs, sn = math.cos(k * r + offset), math.sin(k * r + offset)
                cos_far, sin_far = far_cos * cs + far_sin * sn, far_sin * cs - far_cos * sn
                flux = x * cs + y * sn - hidden * cos_far
                steep = -k * flux - slope * sin_far
                spread = math.sqrt(max(sn * sn * v1 + cs * cs * v2 - 2.0 * sn * cs * v12, 0.0))
                sd = spread / abs(steep)
                lever = slope * cos_far / steep
                g1, g2 = cs - lever * sn, sn + lever * cs
                flux_sd = math.sqrt(max(g1 * g1 * v1 + g2 * g2 * v2 + 2.0 * g1 * g2 * v12, 0.0))
                slack = band * flux_sd + 64.0 * EPSILON * (rho + b) * (1.0 + abs(lever))
                if turn % 2.0 != 0.0 and abs(flux) > slack:
                    continue  # a negative object beyond any noise
                close = False
                for side in range(2):
                    inner = (side == 0 and j > 0) or (side == 1 and j < count)
                    if inner:
                        at = low if side == 0 else high
                        gap = abs((left if side == 0 else right) - goal)
                        reach = gap * _distance_to(at, x, y, b, far_cos, far_sin, p)
                        if reach < band * spread:
                            close = True
                roots[i, found] = r
                sds[i, found] = sd
                near[i, found] = close
                seen = r + c1 >= -(band * sd + 1e-12 * r)
                physical[i, found] = seen
                found += 1
            if j < count:
                # whether noise reaches the fold between this piece and the next
                off = right / (2.0 * math.pi)
                gap = 2.0 * math.pi * abs(off - math.floor(off + 0.5))
                cs, sn = math.cos(k * high + offset), math.sin(k * high + offset)
                spread = math.sqrt(max(sn * sn * v1 + cs * cs * v2 - 2.0 * sn * cs * v12, 0.0))
                reach = gap * _distance_to(high, x, y, b, far_cos, far_sin, p)
                if reach < band * spread:
                    near_frame[i] = True
