"""The geometry of a sine wave's readings before a known background.

The object alone is x - B S(r) e^jkR: as r grows, it moves along a straight line. As seen from x,
theta(r) = k r - arg of it turns where a quartic has its roots: between them every multiple of pi is
met once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from inference.realtime.solving.bracketing import STEPS, best, narrowed, next_point, start
from inference.realtime.solving.known_background import KnownBackground
from inference.realtime.solving.polynomials import fill, real_roots
from simulator.background import shadow
from simulator.compiled import compiled

__all__ = [
    "Direction",
    "Line",
    "ScaledFrame",
    "frame_of",
    "line_of",
    "range_at",
    "theta",
    "turns_of",
]

Array = NDArray[np.float64]


class Direction(NamedTuple):
    """A unit vector: e^jkR of the background, or the object's own."""

    cosine: float
    sine: float


class ScaledFrame(NamedTuple):
    """A frame in units of its largest reading, or of the background's: x + jy, its modulus rho."""

    x: float
    y: float
    rho: float
    b: float
    v1: float
    v2: float
    v12: float


class Line(NamedTuple):
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
def frame_of(net: Net, i: int, strength: float) -> ScaledFrame:
    """Return frame i in units of its largest reading, or of the background's strength."""
    first, second = net.first[i], net.second[i]
    largest = max(abs(first), abs(second))
    size = max(largest, strength)
    return ScaledFrame(
        first / size,
        second / size,
        largest / size * math.hypot(first / largest, second / largest),
        strength / size,
        net.var1[i] / size / size,
        net.var2[i] / size / size,
        net.cov[i] / size / size,
    )


@compiled
def line_of(frame: ScaledFrame, offset: float, far: Direction) -> Line:
    """Return the geometry of a frame."""
    x, y, rho = frame.x, frame.y, frame.rho
    psi = (math.atan2(y, x) - offset) % (2.0 * math.pi)
    # e^j chi, chi = k R - psi, and sin^2(chi / 2) without cancellation
    cosine, sine = (far.cosine * x + far.sine * y) / rho, (far.sine * x - far.cosine * y) / rho
    half = 0.5 * sine * sine / (1.0 + cosine) if cosine > 0.0 else 0.5 * (1.0 - cosine)
    top = max(rho, frame.b)
    return Line(psi, rho / top, frame.b / top, cosine, sine, half)


@compiled
def theta(r: float, line: Line, back: KnownBackground, k: float) -> float:
    """Return k r - psi - arg(mu - nu S e^j chi)."""
    hidden = line.nu * shadow(r, back.c0, back.c1)
    return k * r - line.psi - math.atan2(-hidden * line.sine, line.mu - hidden * line.cosine)


@compiled
def turns_of(line: Line, back: KnownBackground, k: float, quartic: Array, turns: Array) -> int:
    """Fill in the quartic and where theta turns before the background; return how often."""
    c0, c1, mu, nu = back.c0, back.c1, line.mu, line.nu
    whole = (mu - nu) * (mu - nu) + 4.0 * mu * nu * line.half
    real = mu * ((mu - nu) + 2.0 * nu * line.half)
    twist = mu * nu * line.sine
    # with twist >= 0 theta can only turn where 2 r + c1' < 0, if the twist is strong enough
    least = mu * c0 - 0.25 * c1 * c1 * math.sqrt(whole)
    if not twist < 0.0 and least > 0.0 and k * least * least > -twist * c0 * min(c1, 0.0):
        return 0
    coefficients = (
        k * whole,
        2.0 * k * whole * c1,
        k * (whole * c1 * c1 + 2.0 * real * c0),
        2.0 * c0 * (k * real * c1 + twist),
        c0 * (k * mu * mu * c0 + twist * c1),
    )
    fill(quartic, coefficients)
    return real_roots(quartic, 0.0, back.distance, turns)


@compiled
def range_at(
    low: float, high: float, goal: float, line: Line, back: KnownBackground, k: float
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
            r += (goal - theta(r, line, back, k)) / steep
            return float(min(max(r, low), high))
    f_low, f_high = theta(low, line, back, k) - goal, theta(high, line, back, k) - goal
    if (f_low > 0.0) == (f_high > 0.0):  # rounding at an end
        return low if abs(f_low) < abs(f_high) else high
    bracket = start(low, high, f_low, f_high)
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, theta(x, line, back, k) - goal)
    return best(bracket)
