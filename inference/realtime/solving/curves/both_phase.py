"""The angle of a derivative before a background, of a sine wave (docs/model.md, exact).

arg d(Phi e^jku + Phi_bg e^jkR), modulo pi.
"""

import math

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Search
from inference.realtime.solving.curves.terms import (
    Response,
    background_rate,
    background_rates,
    object_bend,
)
from simulator.compiled import compiled
from simulator.object_model import log_slope

__all__ = [
    "CURVE",
    "KIND",
    "direction",
    "guess",
    "residual",
    "response",
    "slope",
    "turning",
    "value",
]

KIND = 7


@compiled
def direction(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the derivative's phasor over Phi / u, as seen from the object's own phase k u."""
    rate = background_rate(u, p)
    far = p.wave * (p.distance - u)
    return log_slope(u, p.c0, p.c1) + rate * math.cos(far), p.wave * u + rate * math.sin(far)


@compiled
def turning(u: float, p: CurveParameters) -> float:
    """Return u (x y' - y x') of the phasor (x, y)."""
    b = log_slope(u, p.c0, p.c1)
    bend = object_bend(u, b, p)
    rate, rate_bend = background_rates(u, p)
    turn, angle = p.wave * u, p.wave * (p.distance - u)
    cosine, sine = math.cos(angle), math.sin(angle)
    # of object and wall; what the wall alone has is zero, and would be nothing but rounding
    dx, dy = bend - turn * turn, 2.0 * turn * b
    own = b * dy - turn * dx
    return own + rate_bend * (b * sine - turn * cosine) + rate * (cosine * dy - sine * dx)


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return the angle, within its branch."""
    x, y = direction(u, p)
    return p.wave * u + math.atan2(y, x)


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    x, y = direction(u, p)
    return turning(u, p) / u / (x * x + y * y)


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    b = log_slope(u, p.c0, p.c1)
    x, y = direction(u, p)
    k, turn = p.wave, p.wave * u
    square = x * x + y * y
    # the object's phasor b + j k u grows by delta and turns by k epsilon; its slopes add to it
    return Response(
        (x * turn - y * b) / square,
        -y / square,
        k * ((x * b + y * turn) / square),
        k * (x / square),
    )


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return that of the object alone: where a square and a fourth law err alike."""
    return 1.6 * (top / bottom) / p.wave


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return the sine of value - top / bottom, times a positive factor.

    The solver's intervals turn by less than a right angle, so that it has the sign of the angle.
    """
    target = top / bottom
    turn = p.wave * u - target
    own = log_slope(u, p.c0, p.c1) * math.sin(turn) + p.wave * u * math.cos(turn)
    # the wall's angle is the same everywhere
    return own + background_rate(u, p) * math.sin(p.wave * p.distance - target)


CURVE = Curve(name="both_phase", kind=KIND, turns=Search(), period=math.pi, winds=True)
