"""What is free of a background at a known distance, of a sine wave (docs/model.md, exact).

sin(k (R - u)) c0 / (u^2 Q).
"""

import math

from inference.realtime.solving.curves import differential_phase, intensity
from inference.realtime.solving.curves.curve import Curve, CurveParameters, Level
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled
from simulator.object_model import log_slope, quadratic

__all__ = ["CURVE", "KIND", "guess", "power_law", "residual", "response", "slope", "value"]

KIND = 5


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return sin(k (R - u)) c0 / (u^2 Q)."""
    return math.sin(p.wave * (p.distance - u)) * intensity.value(u, p)


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    angle = p.wave * (p.distance - u)
    b = log_slope(u, p.c0, p.c1)
    return intensity.value(u, p) * (b * math.sin(angle) / u - p.wave * math.cos(angle))


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    turn = -p.wave * math.cos(p.wave * (p.distance - u))
    return Response(value(u, p), 0.0, turn * intensity.value(u, p), 0.0)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:
    """Return that of the object's light, as if the sine were one."""
    return intensity.guess(top, bottom, p)


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return value - top / bottom."""
    return value(u, p) - top / bottom


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    turn = p.wave * (p.distance - u)
    sine = math.sin(turn)
    height = sine * (p.c0 / quadratic(u, p.c0, p.c1) / u / u)
    return height, log_slope(u, p.c0, p.c1) - p.wave * u * math.cos(turn) / sine


# Phi sin(k (R - r)) turns where the differential phase is k R modulo pi
CURVE = Curve(
    name="cancelling_quadrature",
    kind=KIND,
    turns=Level(differential_phase.CURVE, lambda p: math.fmod(p.wave * p.distance, math.pi)),
)
