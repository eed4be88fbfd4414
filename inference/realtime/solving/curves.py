"""The curves that real-time techniques invert, one number a frame against the range.

Every technique but background intensity reduces a frame to one number t (two for a ratio that may
be infinite, or an angle modulo pi) that the curve takes at the right range; the curve depends on
the scene alone. Lengths are in a unit near sqrt(c0), so that nothing overflows.

========================  ==========================================================  ============
curve                     value at u                                                  equation
========================  ==========================================================  ============
INTENSITY                 c0 / (u^2 Q)                                                4.1
INTENSITY_W1              c0 / (u Q)                                                  4.4
DIFFERENTIAL_RATIO        u (3u^2 + 2 c1 u + c0) / (4u^2 + 3 c1 u + 2 c0)             4.68
DIFFERENTIAL_PHASE        k u - atan2(k u Q, 4u^2 + 3 c1 u + 2 c0), modulo pi         errata, 5
CANCELLING_RATIO          (1 - u/R) c0 / (u^2 Q)                                      4.73
CANCELLING_QUADRATURE     sin(k (R - u)) c0 / (u^2 Q)                                 errata, 5
BOTH_RATIO                d(u Phi + R Phi_bg) / d(Phi + Phi_bg)                       4.83
BOTH_PHASE                arg d(Phi e^jku + Phi_bg e^jkR), modulo pi                  errata, 5
========================  ==========================================================  ============
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.solving.bracketing import STEPS, best, narrowed, next_point, start
from simulator.compiled import compiled
from simulator.object_model import quadratic

__all__ = [
    "BOTH_PHASE",
    "BOTH_RATIO",
    "C0",
    "C0_SHADOW",
    "C1",
    "C1_SHADOW",
    "CANCELLING_QUADRATURE",
    "CANCELLING_RATIO",
    "CONTRAST",
    "DIFFERENTIAL_PHASE",
    "DIFFERENTIAL_RATIO",
    "DISTANCE",
    "INTENSITY",
    "INTENSITY_W1",
    "PARAMETERS",
    "WAVE",
    "direction",
    "slope",
    "solve_between",
    "turning",
    "value",
]

Array = NDArray[np.float64]

INTENSITY, INTENSITY_W1 = 0, 1
DIFFERENTIAL_RATIO, DIFFERENTIAL_PHASE = 2, 3
CANCELLING_RATIO, CANCELLING_QUADRATURE = 4, 5
BOTH_RATIO, BOTH_PHASE = 6, 7

# places in the vector of parameters; CONTRAST is strength / (gain c2) [1 / length^2]
C0, C1, DISTANCE, WAVE, C0_SHADOW, C1_SHADOW, CONTRAST = 0, 1, 2, 3, 4, 5, 6
PARAMETERS = 7


@compiled
def direction(kind: int, u: float, p: Array) -> tuple[float, float]:
    """Return (denominator, numerator) of a ratio, or the direction of the derivative phasor.

    Divided by the positive factor Phi / u. A phasor is as seen from the object's own phase, k u.
    """
    c0, c1 = float(p[C0]), float(p[C1])
    q = quadratic(u, c0, c1)
    b = -2.0 - u * (2.0 * u + c1) / q  # d log Phi / d log u
    if kind == DIFFERENTIAL_RATIO:
        # b and 1 + b as polynomials, because 1 + b may cancel
        under, over = u * (4.0 * u + 3.0 * c1) + 2.0 * c0, u * (3.0 * u + 2.0 * c1) + c0
        return -under / q, -u * over / q
    # u dPhi_bg/du over Phi
    qs = quadratic(u, float(p[C0_SHADOW]), float(p[C1_SHADOW]))
    rate = float(p[CONTRAST]) * (u * u) * (q / c0)
    rate *= u * (float(p[C0_SHADOW]) / qs) * ((2.0 * u + float(p[C1_SHADOW])) / qs)
    if kind == BOTH_RATIO:
        return b + rate, u * (1.0 + b) + float(p[DISTANCE]) * rate
    k = float(p[WAVE])
    far = k * (float(p[DISTANCE]) - u)
    return b + rate * math.cos(far), k * u + rate * math.sin(far)


@compiled
def turning(kind: int, u: float, p: Array) -> float:
    """Return u (x y' - y x') of `direction` (x, y): its sign is that of the curve's slope."""
    c0, c1 = float(p[C0]), float(p[C1])
    q = quadratic(u, c0, c1)
    b = -2.0 - u * (2.0 * u + c1) / q
    # u^2 Phi''/Phi from P''/P: Phi = K/P
    second = 2.0 * b * b - (u * (12.0 * u + 6.0 * c1) + 2.0 * c0) / q
    rate = 0.0
    rate_second = 0.0
    if kind in (BOTH_RATIO, BOTH_PHASE):
        c0s, c1s = float(p[C0_SHADOW]), float(p[C1_SHADOW])
        qs = quadratic(u, c0s, c1s)
        contrast = float(p[CONTRAST]) * (u * u) * (q / c0)
        tilt = u * ((2.0 * u + c1s) / qs)
        rate = contrast * (c0s / qs) * tilt
        rate_second = contrast * (c0s / qs) * 2.0 * (u * u / qs - tilt * tilt)
    if kind in (DIFFERENTIAL_RATIO, BOTH_RATIO):
        # x = u Phi' + .., y = (u Phi)' u + R ..; second derivatives times u
        x, y = b + rate, u * (1.0 + b) + float(p[DISTANCE]) * rate
        dx = second + rate_second
        dy = u * (2.0 * b + second) + float(p[DISTANCE]) * rate_second
        return x * dy - y * dx
    k = float(p[WAVE])
    cosine, sine = math.cos(k * (float(p[DISTANCE]) - u)), math.sin(k * (float(p[DISTANCE]) - u))
    x = b + rate * cosine
    y = k * u + rate * sine
    dx = second - (k * u) * (k * u) + rate_second * cosine
    dy = 2.0 * k * u * b + rate_second * sine
    return x * dy - y * dx


@compiled
def value(kind: int, u: float, p: Array) -> float:
    """Return the curve's value at u; an angle within its branch."""
    if kind in (BOTH_RATIO, DIFFERENTIAL_RATIO):
        x, y = direction(kind, u, p)
        return y / x
    if kind == BOTH_PHASE:
        x, y = direction(kind, u, p)
        return float(p[WAVE]) * u + math.atan2(y, x)
    c0, c1 = float(p[C0]), float(p[C1])
    q = quadratic(u, c0, c1)
    if kind == DIFFERENTIAL_PHASE:
        k = float(p[WAVE])
        return k * u - math.atan2(k * u * q, u * (4.0 * u + 3.0 * c1) + 2.0 * c0)
    flux = c0 / q / u
    if kind == INTENSITY_W1:
        return flux
    flux /= u
    if kind == CANCELLING_RATIO:
        return (float(p[DISTANCE]) - u) / float(p[DISTANCE]) * flux
    if kind == CANCELLING_QUADRATURE:
        return math.sin(float(p[WAVE]) * (float(p[DISTANCE]) - u)) * flux
    return flux


@compiled
def slope(kind: int, u: float, p: Array) -> float:
    """Return d value / du."""
    if kind in (BOTH_RATIO, DIFFERENTIAL_RATIO):
        x, _ = direction(kind, u, p)
        return turning(kind, u, p) / u / x / x
    if kind == BOTH_PHASE:
        x, y = direction(kind, u, p)
        return turning(kind, u, p) / u / (x * x + y * y)
    c0, c1 = float(p[C0]), float(p[C1])
    q = quadratic(u, c0, c1)
    b = -2.0 - u * (2.0 * u + c1) / q
    if kind == DIFFERENTIAL_PHASE:
        k = float(p[WAVE])
        bend = (u * (12.0 * u + 6.0 * c1) + 2.0 * c0) / q
        return k * (k * k * u * u + bend) / (b * b + k * k * u * u)
    flux = c0 / q / u
    if kind == INTENSITY_W1:
        return flux * (1.0 + b) / u
    flux /= u
    if kind == CANCELLING_RATIO:
        return flux * (b * (float(p[DISTANCE]) - u) / u - 1.0) / float(p[DISTANCE])
    if kind == CANCELLING_QUADRATURE:
        k = float(p[WAVE])
        angle = k * (float(p[DISTANCE]) - u)
        return flux * (b * math.sin(angle) / u - k * math.cos(angle))
    return flux * b / u


@compiled
def _residual(kind: int, u: float, top: float, bottom: float, p: Array) -> float:
    """Return a number whose sign is that of value - top/bottom up to a constant factor."""
    if kind in (BOTH_RATIO, DIFFERENTIAL_RATIO):
        x, y = direction(kind, u, p)
        return y * bottom - x * top
    if kind == BOTH_PHASE:
        # pieces turn by less than a right angle, so that a sine has the sign of the angle
        x, y = direction(kind, u, p)
        turn = float(p[WAVE]) * u - top
        return x * math.sin(turn) + y * math.cos(turn)
    if kind in (DIFFERENTIAL_PHASE, CANCELLING_QUADRATURE):
        return value(kind, u, p) - top
    return math.log(value(kind, u, p) / top)


@compiled
def _guess(kind: int, top: float, bottom: float, p: Array) -> float:
    """Return a first guess from the limits of near and far ranges."""
    if kind in (INTENSITY, CANCELLING_RATIO, CANCELLING_QUADRATURE):
        top = abs(top)
        return min(1.0 / math.sqrt(top), math.sqrt(math.sqrt(float(p[C0]) / top)))
    if kind == INTENSITY_W1:
        return min(1.0 / top, math.pow(float(p[C0]) / top, 1.0 / 3.0))
    if kind in (DIFFERENTIAL_RATIO, BOTH_RATIO):
        return 1.6 * abs(top / bottom)
    if kind in (DIFFERENTIAL_PHASE, BOTH_PHASE):
        return 1.6 * top / float(p[WAVE])
    return 0.0


@compiled
def _newton(kind: int, low: float, high: float, top: float, bottom: float, p: Array) -> float:
    """Solve by Newton in logarithms; nan where that leaves the interval or the sign.

    A power law, which every such curve is near both ends, is solved in one step.
    """
    target = top / bottom
    c0, c1 = float(p[C0]), float(p[C1])
    u = _guess(kind, top, bottom, p)
    for _ in range(12):
        if not low < u < high:
            return math.nan
        if kind in (INTENSITY, INTENSITY_W1, CANCELLING_RATIO):
            q = quadratic(u, c0, c1)
            height = c0 / q / u
            power = -1.0 - u * (2.0 * u + c1) / q
            if kind != INTENSITY_W1:
                height /= u
                power -= 1.0
            if kind == CANCELLING_RATIO:
                left = float(p[DISTANCE]) - u
                height *= left / float(p[DISTANCE])
                power -= u / left
        elif kind == DIFFERENTIAL_RATIO:
            over, under = u * (3.0 * u + 2.0 * c1) + c0, u * (4.0 * u + 3.0 * c1) + 2.0 * c0
            height = u * over / under
            power = 1.0 + u * ((6.0 * u + 2.0 * c1) / over - (8.0 * u + 3.0 * c1) / under)
        elif kind == DIFFERENTIAL_PHASE:
            q, under = quadratic(u, c0, c1), u * (4.0 * u + 3.0 * c1) + 2.0 * c0
            x = float(p[WAVE]) * u
            height = x - math.atan2(x * q, under)
            bend = x * x * q + u * (12.0 * u + 6.0 * c1) + 2.0 * c0
            power = x * (bend * q) / (under * under + x * q * x * q) / height
        else:
            q = quadratic(u, c0, c1)
            turn = float(p[WAVE]) * (float(p[DISTANCE]) - u)
            sine = math.sin(turn)
            height = sine * (c0 / q / u / u)
            b = -2.0 - u * (2.0 * u + c1) / q
            power = b - float(p[WAVE]) * u * math.cos(turn) / sine
        ratio = height / target
        if not ratio > 0.0:
            return math.nan
        step = -math.log(ratio) / power
        if not abs(step) < 2.0:
            return math.nan
        if abs(step) < 3e-8:  # what remains is its square
            return min(max(u * (1.0 + step), low), high)
        u *= 1.0 + step + 0.5 * step * step if abs(step) < 0.02 else math.exp(step)
    return math.nan


@compiled
def solve_between(kind: int, low: float, high: float, top: float, bottom: float, p: Array) -> float:
    """Return the u between two points at which a curve monotone between them takes a value.

    Parameters
    ----------
    kind : int
        The curve.
    low, high : float
        Ends, 0 < low < high; the value must lie between those at the ends.
    top, bottom : float
        The value is top / bottom; bottom = 1 but for ratios.
    p : ndarray, shape (PARAMETERS,)
        Parameters.
    """
    if kind not in (BOTH_RATIO, BOTH_PHASE):  # far from power laws
        root = _newton(kind, low, high, top, bottom, p)
        if root == root:
            return root
    f_low = _residual(kind, low, top, bottom, p)
    f_high = _residual(kind, high, top, bottom, p)
    if f_low == 0.0 or (f_low > 0.0) == (f_high > 0.0):
        # rounding at an end: the nearer one is the root
        return low if abs(f_low) <= abs(f_high) else high
    bracket = start(low, high, f_low, f_high)
    x = _guess(kind, top, bottom, p)
    if low < x < high:
        # the guess and a point a factor of two beyond the root are a bracket in most cases
        fx = _residual(kind, x, top, bottom, p)
        if (fx > 0.0) == (f_low > 0.0):
            bracket = start(x, high, fx, f_high)
            x *= 2.0
        else:
            bracket = start(low, x, f_low, fx)
            x *= 0.5
        if low < x < high:
            bracket = narrowed(bracket, x, _residual(kind, x, top, bottom, p))
            bracket = start(bracket[0], bracket[1], bracket[3], bracket[4])
    for _ in range(STEPS):
        x = next_point(bracket)
        if x != x:
            break
        bracket = narrowed(bracket, x, _residual(kind, x, top, bottom, p))
    return best(bracket)
