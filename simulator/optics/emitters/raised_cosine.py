"""A raised cosine of the angle, dark beyond a cut-off."""

import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.emitters.form import PatternForm, packed

__all__ = ["RAISED", "RaisedCosine", "raised_cosine_intensity"]

Array = NDArray[np.float64]

RAISED = 3.0


@compiled
def raised_cosine_intensity(norm: float, cut_off: float, cosine: float, sine: float) -> float:
    """Return (1 + cos(pi alpha / alpha_0)) / 2, normalised; 0 beyond alpha_0."""
    angle = math.atan2(sine, cosine)
    if angle >= cut_off:
        return 0.0
    half = math.cos(0.5 * math.pi * angle / cut_off)
    return norm * half * half


class RaisedCosine(PatternForm):
    """I_e in proportion to (1 + cos(pi alpha / cut_off)) / 2 below the cut-off (App. A, 7).

    Attributes
    ----------
    cut_off_rad : float
        alpha_0, angle of the first zero, between 1e-3 and pi/2.
    """

    kind: Literal["raised_cosine"] = "raised_cosine"
    cut_off_rad: Annotated[float, pydantic.Field(ge=1e-3, le=math.pi / 2)]

    def pack(self) -> tuple[Array, Array]:
        """Pack."""
        cut = self.cut_off_rad
        return packed(RAISED, cut, 1.0 / _norm(cut), cut)


def _norm(cut_off: float) -> float:
    """Return 2 pi int (1 + cos(pi a / a0)) / 2 sin(a) da from 0 to a0."""
    b = math.pi / cut_off  # at least 2
    # int cos(b a) sin(a) da from 0 to pi/b
    cosine = -(1.0 + math.cos(cut_off)) / (b * b - 1.0)
    half = math.sin(0.5 * cut_off)
    return math.pi * (2.0 * half * half + cosine)
