"""The late window of an object: c0 / (u Q) (4.4)."""

import math

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Polynomial
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled
from simulator.object_model import log_slope, quadratic

__all__ = ["CURVE", "KIND", "guess", "power_law", "residual", "response", "slope", "value"]

KIND = 1


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return c0 / (u Q)."""
    return p.c0 / quadratic(u, p.c0, p.c1) / u


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    return value(u, p) * (1.0 + log_slope(u, p.c0, p.c1)) / u


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    late = value(u, p)
    return Response(late, 0.0, late / u, 0.0)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return the smaller of the roots of a first and of a third law."""
    size = top / bottom
    return min(1.0 / size, math.pow(p.c0 / size, 1.0 / 3.0))


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return log(value / (top / bottom))."""
    return math.log(value(u, p) / (top / bottom))


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    q = quadratic(u, p.c0, p.c1)
    return p.c0 / q / u, -1.0 - u * (2.0 * u + p.c1) / q


CURVE = Curve(
    name="intensity_w1",
    kind=KIND,
    turns=Polynomial(lambda p: (3.0, 2.0 * p.c1, p.c0)),
)
