"""The narrow limit: one ray."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from simulator.optics.emitters.form import PatternForm

__all__ = ["Narrow"]

Array = NDArray[np.float64]


class Narrow(PatternForm):
    """The narrow limit of cos^N, N to infinity: all light along the aim."""

    kind: Literal["narrow"] = "narrow"

    def pack(self) -> tuple[Array, Array]:
        """Refuse: a single ray has no intensity (`simulator.optics.narrow` follows it)."""
        raise ValueError("a narrow beam has no radiant intensity")
