"""The ratio of derivatives, of a pulse (4.68).

u (3u^2 + 2 c1 u + c0) / (4u^2 + 3 c1 u + 2 c0).
"""

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Polynomial
from inference.realtime.solving.curves.terms import Response, exact_object, object_bend
from simulator.compiled import compiled
from simulator.object_model import log_slope, quadratic

__all__ = [
    "CURVE",
    "KIND",
    "direction",
    "guess",
    "power_law",
    "residual",
    "response",
    "slope",
    "turning",
    "value",
]

KIND = 2


@compiled
def direction(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return (denominator, numerator) over Phi / u: b and u (1 + b) as polynomials.

    As they stand, 1 + b may cancel.
    """
    q = quadratic(u, p.c0, p.c1)
    under, over = u * (4.0 * u + 3.0 * p.c1) + 2.0 * p.c0, u * (3.0 * u + 2.0 * p.c1) + p.c0
    return -under / q, -u * over / q


@compiled
def turning(u: float, p: CurveParameters) -> float:
    """Return u (x y' - y x') of the direction (x, y)."""
    b = log_slope(u, p.c0, p.c1)
    bend = object_bend(u, b, p)
    return b * (u * (2.0 * b + bend)) - u * (1.0 + b) * bend


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return u (3u^2 + 2 c1 u + c0) / (4u^2 + 3 c1 u + 2 c0)."""
    x, y = direction(u, p)
    return y / x


@compiled
def slope(u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    x, _ = direction(u, p)
    return turning(u, p) / u / x / x


@compiled
def response(u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to the value."""
    b = log_slope(u, p.c0, p.c1)
    return Response(0.0, -u / b / b, 1.0, 1.0 / b)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:  # noqa: ARG001
    """Return the range at which a square and a fourth law err alike."""
    return 1.6 * abs(top / bottom)


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return numerator bottom - denominator top, which has no pole."""
    x, y = direction(u, p)
    return y * bottom - x * top


@compiled
def power_law(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return the value and its logarithmic slope."""
    over, under = u * (3.0 * u + 2.0 * p.c1) + p.c0, u * (4.0 * u + 3.0 * p.c1) + 2.0 * p.c0
    power = 1.0 + u * ((6.0 * u + 2.0 * p.c1) / over - (8.0 * u + 3.0 * p.c1) / under)
    return u * over / under, power


def _exact(u: float, p: CurveParameters) -> float:
    top, bottom = exact_object(u, p)
    return float(top / bottom) if bottom else float("inf")


CURVE = Curve(
    name="differential_ratio",
    kind=KIND,
    turns=Polynomial(lambda p: (6.0, 3.0 * p.c1, p.c0)),
    poles=Polynomial(lambda p: (4.0, 3.0 * p.c1, 2.0 * p.c0)),
    exact=_exact,
)
