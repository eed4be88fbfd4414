"""What is free of a background at a known distance, of a pulse: (1 - u/R) c0 / (u^2 Q) (4.73)."""

import math

from inference.realtime.solving.curves import intensity
from inference.realtime.solving.curves.curve import Curve, CurveParameters, Polynomial
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled
from simulator.object_model import log_slope

__all__ = ["CURVE", "KIND", "guess", "power_law", "residual", "response", "slope", "value"]

KIND = 4


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return (1 - u/R) c0 / (u^2 Q)."""
    return (p.distance - u) / p.distance * intensity.value(u, p)


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    b = log_slope(u, p.c0, p.c1)
    return intensity.value(u, p) * (b * (p.distance - u) / u - 1.0) / p.distance


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    return Response(value(u, p), 0.0, -intensity.value(u, p) / p.distance, 0.0)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return that of the object's light, as if the background were far."""
    return intensity.guess(top, bottom, p)


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return log(value / (top / bottom))."""
    return math.log(value(u, p) / (top / bottom))


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    height, power = intensity.power_law(u, p)
    left = p.distance - u
    return height * (left / p.distance), power - u / left


CURVE = Curve(
    name="cancelling_ratio",
    kind=KIND,
    turns=Polynomial(
        lambda p: (
            -3.0,
            4.0 * p.distance - 2.0 * p.c1,
            3.0 * p.c1 * p.distance - p.c0,
            2.0 * p.c0 * p.distance,
        )
    ),
)
