"""The amount of light of an object, w2 or the modulus: c0 / (u^2 Q) (4.1)."""

import math

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Polynomial
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled
from simulator.object_model import log_slope, quadratic

__all__ = ["CURVE", "KIND", "guess", "power_law", "residual", "response", "slope", "value"]

KIND = 0


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return c0 / (u^2 Q)."""
    return p.c0 / quadratic(u, p.c0, p.c1) / u / u


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    return value(u, p) * log_slope(u, p.c0, p.c1) / u


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    return Response(value(u, p), 0.0, 0.0, 0.0)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return the smaller of the roots of a square and of a fourth law."""
    size = abs(top / bottom)
    return min(1.0 / math.sqrt(size), math.sqrt(math.sqrt(p.c0 / size)))


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return log(value / (top / bottom))."""
    return math.log(value(u, p) / (top / bottom))


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    q = quadratic(u, p.c0, p.c1)
    return p.c0 / q / u / u, -1.0 - u * (2.0 * u + p.c1) / q - 1.0


CURVE = Curve(
    name="intensity",
    kind=KIND,
    turns=Polynomial(lambda p: (4.0, 3.0 * p.c1, 2.0 * p.c0)),
)
