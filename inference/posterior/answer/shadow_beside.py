"""What an error of the shadow does to an answer of which the flux's error is integrated out."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.discrepant import DiscrepantDensity
from inference.frame.shadow_error import shadow_basis
from inference.identifiability.experiment import Experiment
from inference.identifiability.range_response import shadow_response

__all__ = ["shadow_beside", "with_shadow"]

Array = NDArray[np.float64]


def with_shadow(
    density: DiscrepantDensity, experiments: Sequence[Experiment], size: float
) -> list[Experiment]:
    """Give draws the flux's error that the readings ask for, and one of the shadow.

    Parameters
    ----------
    density : DiscrepantDensity
        Of the job.
    size : float
        Standard deviation of the shadow's error.
    """
    centres, _, _ = density.expansions(np.array([each.z for each in experiments]))
    none = np.zeros(2 * shadow_basis(*density.parameters.reach_m).size)
    return [
        dataclasses.replace(
            each,
            discrepancy=density.discrepancy,
            shadow=size,
            error=np.concatenate([of, none]),
        )
        for each, of in zip(experiments, centres, strict=True)
    ]


def shadow_beside(experiments: Sequence[Experiment], readings: Array) -> tuple[Array, Array]:
    """Return how z and ranges follow errors of the shadow, the flux's following too.

    Parameters
    ----------
    experiments : sequence of m Experiment
        Draws, from `with_shadow`.
    readings : ndarray, shape (frames, 2 or 4)
        As for `inference.identifiability.range_response.shadow_response`.

    Returns
    -------
    (ndarray, ndarray)
        Shapes (m, d, 1 + k) and (m, frames, 1 + k), as `ErrorBudget` has them.
    """
    found = [shadow_response(each, readings) for each in experiments]
    return np.array([each[0] for each in found]), np.array([each[1] for each in found])
