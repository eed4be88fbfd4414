"""The ratio of derivatives before a background, of a pulse (4.83).

d(u Phi + R Phi_bg) / d(Phi + Phi_bg).
"""

import math
from fractions import Fraction

from inference.realtime.solving.curves.curve import Curve, CurveParameters, Search
from inference.realtime.solving.curves.terms import (
    Response,
    background_rate,
    background_rates,
    exact_object,
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

KIND = 6


@compiled
def direction(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return (denominator, numerator) over Phi / u."""
    b = log_slope(u, p.c0, p.c1)
    rate = background_rate(u, p)
    return b + rate, u * (1.0 + b) + p.distance * rate


@compiled
def turning(u: float, p: CurveParameters) -> float:
    """Return u (x y' - y x') of the direction (x, y)."""
    b = log_slope(u, p.c0, p.c1)
    bend = object_bend(u, b, p)
    rate, rate_bend = background_rates(u, p)
    # of object and wall; what the wall alone has is zero, and would be nothing but rounding
    y, dy = u * (1.0 + b), u * (2.0 * b + bend)
    own = b * dy - y * bend
    return own + rate * (dy - p.distance * bend) + rate_bend * (p.distance * b - y)


@compiled
def value(u: float, p: CurveParameters) -> float:
    """Return d(u Phi + R Phi_bg) / d(Phi + Phi_bg)."""
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
    x, y = direction(u, p)
    q = y / x
    return Response((u * (1.0 + b) - q * b) / x, (u - q) / x, b / x, 1.0 / x)


@compiled
def guess(top: float, bottom: float, p: CurveParameters) -> float:  # noqa: ARG001
    """Return that of the object alone: where a square and a fourth law err alike."""
    return 1.6 * abs(top / bottom)


@compiled
def residual(u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return numerator bottom - denominator top, which has no pole."""
    b = log_slope(u, p.c0, p.c1)
    own = u * (1.0 + b) * bottom - b * top
    # q = R to within rounding leaves the wall nothing
    return own + background_rate(u, p) * (p.distance * bottom - top)


def _exact(u: float, p: CurveParameters) -> float:
    r, c0, c1, far, c0s, c1s, contrast = (
        Fraction(x) for x in (u, p.c0, p.c1, p.distance, p.c0_shadow, p.c1_shadow, p.contrast)
    )
    q = r * (r + c1) + c0
    top, bottom = exact_object(u, p)
    rate = contrast / c0 * c0s * (2 * r + c1s) * r**3 * (q / (r * (r + c1s) + c0s)) ** 2
    top, bottom = top + far * rate, bottom + rate
    return float(top / bottom) if bottom else math.inf


CURVE = Curve(name="both_ratio", kind=KIND, turns=Search(), poles=Search(), exact=_exact)
