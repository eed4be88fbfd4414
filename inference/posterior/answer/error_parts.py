"""What a standard deviation is made of."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

__all__ = ["ErrorParts", "ParameterErrorParts", "of_sd"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class ErrorParts:
    """Parts of standard deviations; their squares add up to its square.

    Attributes
    ----------
    noise : ndarray, shape (n,)
        Of the frame's noise, everything that frames share being known; of a parameter with all
        other unknowns known.
    scene : ndarray, shape (n,)
        Of what all frames share and is not known, and of what rests on the law of the ranges.
    model : ndarray, shape (n,)
        Of the errors of flux, effective distance and shadow that the scene allows for.
    """

    noise: Array
    scene: Array
    model: Array


@dataclasses.dataclass(frozen=True)
class ParameterErrorParts:
    """Parts of the standard deviation of one parameter, in its unit.

    Attributes
    ----------
    noise, scene, model : float
        As in `ErrorParts`; nan where there is no standard deviation.
    """

    noise: float
    scene: float
    model: float


def of_sd(shares: ErrorParts, sd: Array) -> ErrorParts:
    """Return the parts of standard deviations from their shares."""
    return ErrorParts(shares.noise * sd, shares.scene * sd, shares.model * sd)
