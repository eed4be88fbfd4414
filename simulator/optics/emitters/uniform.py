"""The same light in every direction of the front hemisphere."""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.emitters.form import PatternForm, packed

__all__ = ["UNIFORM", "Uniform", "uniform_intensity"]

Array = NDArray[np.float64]

UNIFORM = 0.0


@compiled
def uniform_intensity(norm: float) -> float:
    """Return 1 / (2 pi)."""
    return norm


class Uniform(PatternForm):
    """I_e = Phi0 / (2 pi) over the front hemisphere."""

    kind: Literal["uniform"] = "uniform"

    def pack(self) -> tuple[Array, Array]:
        """Pack."""
        return packed(UNIFORM, 0.0, 0.5 / math.pi, math.pi / 2)
