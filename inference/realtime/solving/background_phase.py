"""Background intensity of a sine wave: what the background leaves has the phase of the range.

x - B S(r) e^jkR is the object alone, so theta(r) = k r - arg(x - B S e^jkR) is a multiple of 2 pi.
B S moves along a straight line, so that arg is monotone in S, and theta turns where a quartic has
its roots: between them every multiple of pi is met once.
"""

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
from inference.realtime.solving.polynomials import real_roots
from simulator.background import shadow, shadow_slope
from simulator.compiled import compiled

__all__ = ["Phase", "solve_phase"]

Array = NDArray[np.float64]


class Phase(NamedTuple):
    """What phases are computed from.

    Attributes
    ----------
    wave : float
        Wave number k, in one over the background's unit of length.
    offset, far : float
        Phase offset, and k R reduced exactly [rad].
    """

    wave: float
    offset: float
    far: float


class _Direction(NamedTuple):
    """A unit vector: e^jkR of the background, or the object's own."""

    cosine: float
    sine: float


class _Frame(NamedTuple):
    """A frame in units of its largest reading, or of the background's: x + jy, its modulus rho."""

    x: float
    y: float
    rho: float
    b: float
    v1: float
    v2: float
    v12: float


class _Line(NamedTuple):
    """The line x - B S e^jkR as seen from x, in units of the larger: mu - nu S e^j chi.

    psi is the phase of x, ``cosine`` and ``sine`` are those of chi = k R - psi, ``half`` is
    sin^2(chi / 2).
    """

    psi: float
    mu: float
    nu: float
    cosine: float
    sine: float
    half: float


@compiled
def _frame(net: Net, i: int, strength: float) -> _Frame:
    first, second = net.first[i], net.second[i]
    largest = max(abs(first), abs(second))
    size = max(largest, strength)
    return _Frame(
        first / size,
        second / size,
        largest / size * math.hypot(first / largest, second / largest),
        strength / size,
        net.var1[i] / size / size,
        net.var2[i] / size / size,
        net.cov[i] / size / size,
    )


@compiled
def _line(frame: _Frame, offset: float, far: _Direction) -> _Line:
    """Return the geometry of a frame."""
    x, y, rho = frame.x, frame.y, frame.rho
    psi = (math.atan2(y, x) - offset) % (2.0 * math.pi)
    # e^j chi, chi = k R - psi, and sin^2(chi / 2) without cancellation
    cosine, sine = (far.cosine * x + far.sine * y) / rho, (far.sine * x - far.cosine * y) / rho
    half = 0.5 * sine * sine / (1.0 + cosine) if cosine > 0.0 else 0.5 * (1.0 - cosine)
    top = max(rho, frame.b)
    return _Line(psi, rho / top, frame.b / top, cosine, sine, half)


@compiled
def _theta(r: float, line: _Line, back: KnownBackground, k: float) -> float:
    """Return k r - psi - arg(mu - nu S e^j chi)."""
    hidden = line.nu * shadow(r, back.c0, back.c1)
    return k * r - line.psi - math.atan2(-hidden * line.sine, line.mu - hidden * line.cosine)


@compiled
def _turns(line: _Line, back: KnownBackground, k: float, quartic: Array, turns: Array) -> int:
    """Fill in the quartic and where theta turns before the background; return how often."""
    c0, c1, mu, nu = back.c0, back.c1, line.mu, line.nu
    whole = (mu - nu) * (mu - nu) + 4.0 * mu * nu * line.half
    real = mu * ((mu - nu) + 2.0 * nu * line.half)
    twist = mu * nu * line.sine
    # with twist >= 0 theta can only turn where 2 r + c1' < 0, if the twist is strong enough
    least = mu * c0 - 0.25 * c1 * c1 * math.sqrt(whole)
    if not twist < 0.0 and least > 0.0 and k * least * least > -twist * c0 * min(c1, 0.0):
        return 0
    quartic[:] = (
        k * whole,
        2.0 * k * whole * c1,
        k * (whole * c1 * c1 + 2.0 * real * c0),
        2.0 * c0 * (k * real * c1 + twist),
        c0 * (k * mu * mu * c0 + twist * c1),
    )
    return real_roots(quartic, 0.0, back.distance, turns)


@compiled
def _between(
    low: float, high: float, goal: float, line: _Line, back: KnownBackground, k: float
) -> float:
    """Return where theta, monotone between two points, takes a value."""
    mu, nu = line.mu, line.nu
    # Newton from the range of an object alone
    r = (goal + line.psi) / k
    for _ in range(10):
        if not low < r < high:
            break
        q = r * (r + back.c1) + back.c0
        hidden = nu * (r * (r + back.c1) / q)
        x, y = mu - hidden * line.cosine, -hidden * line.sine
        steep = (back.c0 / q) * ((2.0 * r + back.c1) / q)
        steep = k + mu * nu * line.sine * steep / (x * x + y * y)
        step = (goal - (k * r - line.psi - math.atan2(y, x))) / steep
        r += step
        if abs(step) < 1e-8 * r:  # what remains is its square
            r += (goal - _theta(r, line, back, k)) / steep
            return float(min(max(r, low), high))
    f_low, f_high = _theta(low, line, back, k) - goal, _theta(high, line, back, k) - goal
    if (f_low > 0.0) == (f_high > 0.0):  # rounding at an end
        return low if abs(f_low) < abs(f_high) else high
    bracket = start(low, high, f_low, f_high)
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, _theta(x, line, back, k) - goal)
    return best(bracket)


@compiled
def _length(r: float, frame: _Frame, far: _Direction, back: KnownBackground) -> float:
    """Return abs(x - B S(r) e^jkR), which turns an angle into a reading."""
    hidden = frame.b * shadow(r, back.c0, back.c1)
    return math.hypot(frame.x - hidden * far.cosine, frame.y - hidden * far.sine)


@compiled
def _spread(along: _Direction, frame: _Frame) -> float:
    """Return the standard deviation of a reading across a direction."""
    cs, sn = along.cosine, along.sine
    variance = sn * sn * frame.v1 + cs * cs * frame.v2 - 2.0 * sn * cs * frame.v12
    return math.sqrt(max(variance, 0.0))


@compiled
def _own_direction(
    r: float, turn: float, frame: _Frame, far: _Direction, back: KnownBackground, phase: Phase
) -> _Direction:
    """Return the direction of the object's own readings at a root."""
    hidden = frame.b * shadow(r, back.c0, back.c1)
    cs, sn = frame.x - hidden * far.cosine, frame.y - hidden * far.sine
    length = math.hypot(cs, sn)
    if length > 0.0:
        sign = 1.0 if turn % 2.0 == 0.0 else -1.0
        return _Direction(sign * cs / length, sign * sn / length)
    angle = phase.wave * r + phase.offset
    return _Direction(math.cos(angle), math.sin(angle))


@compiled
def _error_bar(
    r: float,
    frame: _Frame,
    far: _Direction,
    own: _Direction,
    back: KnownBackground,
    k: float,
    band: float,
) -> tuple[float, float, float]:
    """Return a root's standard deviation, the object's light there, and how far that may err."""
    hidden = frame.b * shadow(r, back.c0, back.c1)
    slope = frame.b * shadow_slope(r, back.c0, back.c1)
    cs, sn = own.cosine, own.sine
    # the background's direction as seen from the object's
    cos_far, sin_far = far.cosine * cs + far.sine * sn, far.sine * cs - far.cosine * sn
    flux = frame.x * cs + frame.y * sn - hidden * cos_far
    steep = -k * flux - slope * sin_far
    lever = slope * cos_far / steep
    g1, g2 = cs - lever * sn, sn + lever * cs
    variance = g1 * g1 * frame.v1 + g2 * g2 * frame.v2 + 2.0 * g1 * g2 * frame.v12
    slack = band * math.sqrt(max(variance, 0.0))
    slack += 64.0 * EPSILON * (frame.rho + frame.b) * (1.0 + abs(lever))
    return _spread(own, frame) / abs(steep), flux, slack


@compiled
def solve_phase(net: Net, back: KnownBackground, phase: Phase, band: float, found: Found) -> None:
    """Find all roots of every frame with an object that is not negative beyond noise.

    Parameters
    ----------
    net : Net
        Net readings of n frames; those of a state other than 0 are passed over.
    back : KnownBackground
        The background.
    phase : Phase
        Wave number and phases.
    band : float
        Standard deviations that count as within the noise.
    found : Found
        Receives the results.
    """
    k = phase.wave
    angle = phase.far + phase.offset
    far = _Direction(math.cos(angle), math.sin(angle))
    quartic, turns, ends = np.empty(5), np.empty(5), np.empty(6)
    for i in range(net.first.size):
        if net.state[i] != 0 or (net.first[i] == 0.0 and net.second[i] == 0.0):
            continue
        frame = _frame(net, i, back.strength)
        line = _line(frame, phase.offset, far)
        count = _turns(line, back, k, quartic, turns)
        ends[0] = LEAST
        for j in range(count):
            ends[j + 1] = turns[j]
        ends[count + 1] = back.distance
        roots = 0
        for j in range(count + 1):
            low, high = ends[j], ends[j + 1]
            left, right = _theta(low, line, back, k), _theta(high, line, back, k)
            first_turn = math.ceil(min(left, right) / math.pi)
            last_turn = math.floor(max(left, right) / math.pi)
            for step in range(int(last_turn - first_turn) + 1):
                turn = first_turn + step if left < right else last_turn - step
                goal = turn * math.pi
                r = _between(low, high, goal, line, back, k)
                if not 0.0 < r < back.distance or (roots > 0 and r <= found.roots[i, roots - 1]):
                    continue
                if roots == found.roots.shape[1]:
                    continue
                own = _own_direction(r, turn, frame, far, back, phase)
                sd, flux, slack = _error_bar(r, frame, far, own, back, k, band)
                if turn % 2.0 != 0.0 and abs(flux) > slack:
                    continue  # a negative object beyond any noise
                reach = band * _spread(own, frame)
                near = j > 0 and abs(left - goal) * _length(low, frame, far, back) < reach
                near |= j < count and abs(right - goal) * _length(high, frame, far, back) < reach
                found.roots[i, roots], found.sds[i, roots] = r, sd
                found.near[i, roots] = near
                found.physical[i, roots] = r + back.c1 >= -(band * sd + 1e-12 * r)
                roots += 1
            if j < count:
                # whether noise reaches the fold between this interval and the next
                off = right / (2.0 * math.pi)
                gap = 2.0 * math.pi * abs(off - math.floor(off + 0.5))
                there = _Direction(
                    math.cos(k * high + phase.offset), math.sin(k * high + phase.offset)
                )
                if gap * _length(high, frame, far, back) < band * _spread(there, frame):
                    found.near_frame[i] = True
