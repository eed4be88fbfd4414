"""Every curve: its file, one line here, and its cases in `dispatch`."""

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
from inference.realtime.solving.curves.curve import Curve

__all__ = ["CURVES"]

CURVES: tuple[Curve, ...] = (
    intensity.CURVE,
    intensity_w1.CURVE,
    differential_ratio.CURVE,
    differential_phase.CURVE,
    cancelling_ratio.CURVE,
    cancelling_quadrature.CURVE,
    both_ratio.CURVE,
    both_phase.CURVE,
)
