"""The angle of a derivative, of a sine wave (exactly: docs/model.md, exact).

k u - atan2(k u Q, 4u^2 + 3 c1 u + 2 c0), modulo pi.
"""

import math

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Polynomial
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled
from simulator.object_model import log_slope, quadratic

__all__ = ["CURVE", "KIND", "guess", "power_law", "residual", "response", "slope", "value"]

KIND = 3


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return k u - atan2(k u Q, 4u^2 + 3 c1 u + 2 c0)."""
    x = p.wave * u
    under = u * (4.0 * u + 3.0 * p.c1) + 2.0 * p.c0
    return x - math.atan2(x * quadratic(u, p.c0, p.c1), under)


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    k = p.wave
    bend = (u * (12.0 * u + 6.0 * p.c1) + 2.0 * p.c0) / quadratic(u, p.c0, p.c1)
    b = log_slope(u, p.c0, p.c1)
    return k * (k * k * u * u + bend) / (b * b + k * k * u * u)


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    b = log_slope(u, p.c0, p.c1)
    x = p.wave * u
    square = b * b + x * x
    return Response(0.0, -x / square, p.wave, p.wave * (b / square))


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return the range at which a square and a fourth law err alike."""
    return 1.6 * (top / bottom) / p.wave


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return value - top / bottom."""
    return value(u, p) - top / bottom


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    q = quadratic(u, p.c0, p.c1)
    under = u * (4.0 * u + 3.0 * p.c1) + 2.0 * p.c0
    x = p.wave * u
    height = value(u, p)
    bend = x * x * q + u * (12.0 * u + 6.0 * p.c1) + 2.0 * p.c0
    return height, x * (bend * q) / (under * under + x * q * x * q) / height


def _bends(p: CurveParameters) -> tuple[float, ...]:
    square = p.wave * p.wave
    return square, square * p.c1, square * p.c0 + 12.0, 6.0 * p.c1, 2.0 * p.c0


CURVE = Curve(name="differential_phase", kind=KIND, turns=Polynomial(_bends), period=math.pi)
