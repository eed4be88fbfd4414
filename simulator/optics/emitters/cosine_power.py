"""Powers of the cosine: Lambertian sources and lobes."""

import math
from typing import Annotated, Literal

import numpy as np
import pydantic
from numpy.typing import NDArray

from simulator.compiled import compiled
from simulator.optics.emitters.form import PatternForm, packed

__all__ = ["COSINE", "CosinePower", "cosine_intensity", "lambertian"]

Array = NDArray[np.float64]

COSINE = 1.0


@compiled
def cosine_intensity(norm: float, power: float, cosine: float) -> float:
    """Return (N + 1) / (2 pi) cos^N."""
    return norm * (cosine if power == 1.0 else cosine**power)


class CosinePower(PatternForm):
    """I_e = Phi0 (N + 1) / (2 pi) cos^N(alpha); N = 1 is a Lambertian source.

    Attributes
    ----------
    exponent : float
        N, not negative.
    """

    kind: Literal["cosine_power"] = "cosine_power"
    exponent: Annotated[float, pydantic.Field(ge=0, le=1e6)]

    def pack(self) -> tuple[Array, Array]:
        """Pack."""
        n = self.exponent
        return packed(COSINE, n, (n + 1.0) / (2 * math.pi), math.pi / 2)


def lambertian() -> CosinePower:
    """Return the pattern of a Lambertian source, I_e = Phi0 cos(alpha) / pi."""
    return CosinePower(exponent=1.0)
