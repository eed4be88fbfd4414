"""Derivatives along the range of the object's light and of the background's, as curves need them.

Divided by Phi: b = u Phi'/Phi, and so on. The background's part comes from dS/du of its shadow.
"""

from fractions import Fraction
from typing import NamedTuple

from inference.realtime.solving.curves.curve import CurveParameters
from simulator.compiled import compiled
from simulator.object_model import quadratic

__all__ = ["Response", "background_rate", "background_rates", "exact_object", "object_bend"]


class Response(NamedTuple):
    """What errors of the model do to a curve's value at a point (docs/model.md, model-error).

    The object's light is Phi exp(delta) and its time of flight that of u + epsilon; the errors and
    their slopes along log u are independent of one another at a point.

    Attributes
    ----------
    flux, flux_slope : float
        Derivatives of the value to delta and to d delta / d log u.
    late, late_slope : float
        Derivatives to epsilon and to d epsilon / d log u [1 / length].
    """

    flux: float
    flux_slope: float
    late: float
    late_slope: float


@compiled
def object_bend(u: float, b: float, p: CurveParameters) -> float:
    """Return u^2 Phi''/Phi, from P''/P with Phi = K/P; b is the logarithmic slope."""
    q = quadratic(u, p.c0, p.c1)
    return 2.0 * b * b - (u * (12.0 * u + 6.0 * p.c1) + 2.0 * p.c0) / q


@compiled
def background_rate(u: float, p: CurveParameters) -> float:
    """Return u Phi_bg'/Phi."""
    q, qs = quadratic(u, p.c0, p.c1), quadratic(u, p.c0_shadow, p.c1_shadow)
    rate = p.contrast * (u * u) * (q / p.c0)
    return rate * (u * (p.c0_shadow / qs) * ((2.0 * u + p.c1_shadow) / qs))


@compiled
def background_rates(u: float, p: CurveParameters) -> tuple[float, float]:
    """Return u Phi_bg'/Phi and u^2 Phi_bg''/Phi."""
    q, qs = quadratic(u, p.c0, p.c1), quadratic(u, p.c0_shadow, p.c1_shadow)
    contrast = p.contrast * (u * u) * (q / p.c0)
    tilt = u * ((2.0 * u + p.c1_shadow) / qs)
    rate = contrast * (p.c0_shadow / qs) * tilt
    return rate, contrast * (p.c0_shadow / qs) * 2.0 * (u * u / qs - tilt * tilt)


def exact_object(u: float, p: CurveParameters) -> tuple[Fraction, Fraction]:
    """Return d(r Phi) and d Phi of the object alone, times r^3 Q^2 / c0, free of rounding."""
    r, c0, c1 = Fraction(u), Fraction(p.c0), Fraction(p.c1)
    return -r * (3 * r * r + 2 * c1 * r + c0), -(4 * r * r + 3 * c1 * r + 2 * c0)
