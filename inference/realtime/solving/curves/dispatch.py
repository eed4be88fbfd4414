"""The one place where a curve is chosen by its number.

Machine code that calls functions it is given cannot be kept between runs, so each function here is
a chain of cases over all curves, and the solver calls these. A number without a case gives nan,
never the formula of another curve.
"""

import math

from inference.realtime.solving.curves import (
    both_phase,
    both_ratio,
    cancelling_quadrature,
    cancelling_ratio,
    differential_phase,
    differential_ratio,
    intensity,
    intensity_w1,
)
from inference.realtime.solving.curves.curve import CurveParameters
from inference.realtime.solving.curves.terms import Response
from simulator.compiled import compiled

__all__ = [
    "direction",
    "guess",
    "power_law",
    "residual",
    "response",
    "slope",
    "turning",
    "value",
]


@compiled
def value(kind: int, u: float, p: CurveParameters) -> float:
    """Return a curve's value at u; an angle within its branch."""
    if kind == intensity.KIND:
        return intensity.value(u, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.value(u, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.value(u, p)
    if kind == differential_phase.KIND:
        return differential_phase.value(u, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.value(u, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.value(u, p)
    if kind == both_ratio.KIND:
        return both_ratio.value(u, p)
    if kind == both_phase.KIND:
        return both_phase.value(u, p)
    return math.nan


@compiled
def slope(kind: int, u: float, p: CurveParameters) -> float:
    """Return d value / du."""
    if kind == intensity.KIND:
        return intensity.slope(u, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.slope(u, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.slope(u, p)
    if kind == differential_phase.KIND:
        return differential_phase.slope(u, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.slope(u, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.slope(u, p)
    if kind == both_ratio.KIND:
        return both_ratio.slope(u, p)
    if kind == both_phase.KIND:
        return both_phase.slope(u, p)
    return math.nan


@compiled
def response(kind: int, u: float, p: CurveParameters) -> Response:
    """Return what errors of the model do to a curve's value."""
    if kind == intensity.KIND:
        return intensity.response(u, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.response(u, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.response(u, p)
    if kind == differential_phase.KIND:
        return differential_phase.response(u, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.response(u, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.response(u, p)
    if kind == both_ratio.KIND:
        return both_ratio.response(u, p)
    if kind == both_phase.KIND:
        return both_phase.response(u, p)
    return Response(math.nan, math.nan, math.nan, math.nan)


@compiled
def guess(kind: int, top: float, bottom: float, p: CurveParameters) -> float:
    """Return about where the value is top / bottom."""
    if kind == intensity.KIND:
        return intensity.guess(top, bottom, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.guess(top, bottom, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.guess(top, bottom, p)
    if kind == differential_phase.KIND:
        return differential_phase.guess(top, bottom, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.guess(top, bottom, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.guess(top, bottom, p)
    if kind == both_ratio.KIND:
        return both_ratio.guess(top, bottom, p)
    if kind == both_phase.KIND:
        return both_phase.guess(top, bottom, p)
    return math.nan


@compiled
def residual(kind: int, u: float, top: float, bottom: float, p: CurveParameters) -> float:
    """Return a number with the sign of value - top / bottom, up to a constant factor."""
    if kind == intensity.KIND:
        return intensity.residual(u, top, bottom, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.residual(u, top, bottom, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.residual(u, top, bottom, p)
    if kind == differential_phase.KIND:
        return differential_phase.residual(u, top, bottom, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.residual(u, top, bottom, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.residual(u, top, bottom, p)
    if kind == both_ratio.KIND:
        return both_ratio.residual(u, top, bottom, p)
    if kind == both_phase.KIND:
        return both_phase.residual(u, top, bottom, p)
    return math.nan


@compiled
def power_law(kind: int, u: float, p: CurveParameters) -> tuple[float, float]:
    """Return (value, d log value / d log u); nan of a curve that is far from power laws."""
    if kind == intensity.KIND:
        return intensity.power_law(u, p)
    if kind == intensity_w1.KIND:
        return intensity_w1.power_law(u, p)
    if kind == differential_ratio.KIND:
        return differential_ratio.power_law(u, p)
    if kind == differential_phase.KIND:
        return differential_phase.power_law(u, p)
    if kind == cancelling_ratio.KIND:
        return cancelling_ratio.power_law(u, p)
    if kind == cancelling_quadrature.KIND:
        return cancelling_quadrature.power_law(u, p)
    return math.nan, math.nan


@compiled
def direction(kind: int, u: float, p: CurveParameters) -> tuple[float, float]:
    """Return (denominator, numerator) of a ratio or an angle of derivatives; nan of others."""
    if kind == differential_ratio.KIND:
        return differential_ratio.direction(u, p)
    if kind == both_ratio.KIND:
        return both_ratio.direction(u, p)
    if kind == both_phase.KIND:
        return both_phase.direction(u, p)
    return math.nan, math.nan


@compiled
def turning(kind: int, u: float, p: CurveParameters) -> float:
    """Return a number with the sign of the slope, of ratios and angles of derivatives; else nan."""
    if kind == differential_ratio.KIND:
        return differential_ratio.turning(u, p)
    if kind == both_ratio.KIND:
        return both_ratio.turning(u, p)
    if kind == both_phase.KIND:
        return both_phase.turning(u, p)
    return math.nan
