"""What every emitter pattern is able to do: turn itself into numbers for its kernel."""

import abc

import numpy as np
from numpy.typing import NDArray

from simulator.validated import Validated

__all__ = ["PatternForm", "packed"]

Array = NDArray[np.float64]


class PatternForm(Validated, abc.ABC):
    """Radiant intensity against the angle from the aim.

    Beside each form stands its kernel, which gives I_e / Phi0 [1/sr] in front of the emitter, and
    which `simulator.optics.emitters.intensity` calls by the form's code. It integrates to 1 over
    the front hemisphere (2.11).
    """

    @abc.abstractmethod
    def pack(self) -> tuple[Array, Array]:
        """Return (code, parameter, normalisation, last angle) and a table of shape (3, n)."""


def packed(code: float, parameter: float, norm: float, last: float) -> tuple[Array, Array]:
    """Return what a form without a table is packed to."""
    return np.array([code, parameter, norm, last]), np.zeros((3, 2))
