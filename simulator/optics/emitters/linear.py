"""Light that falls in proportion to the angle."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.emitters.form import PatternForm, packed

__all__ = ["LINEAR", "Linear", "linear_intensity"]

Array = NDArray[np.float64]

LINEAR = 2.0


@compiled
def linear_intensity(norm: float, cosine: float, sine: float) -> float:
    """Return (pi/2 - alpha) / (pi (pi - 2))."""
    return norm * math.atan2(cosine, sine)


class Linear(PatternForm):
    """I_e = Phi0 (pi/2 - alpha) / (pi (pi - 2))."""

    kind: Literal["linear"] = "linear"

    def pack(self) -> tuple[Array, Array]:
        """Pack."""
        return packed(LINEAR, 0.0, 1.0 / (math.pi * (math.pi - 2.0)), math.pi / 2)
