"""What draws of an exact model owe to their branch where errors of the model bend the response."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum

__all__ = ["where_bent"]

Array = NDArray[np.float64]

_STARTS, _FRAMES = 4, 2400  # climbs, and frames of all of them


def where_bent(
    experiments: Sequence[Experiment], readings: Array, z: Array, log_r: Array
) -> tuple[Array, Array]:
    """Return how far the best point of unknowns, ranges and errors together lies from the draws.

    An exact model may hold a narrow branch of its posterior for improbable beside a wide one that
    fits no better. Errors widen the narrow one, and no draw is there to follow them.

    Parameters
    ----------
    experiments : sequence of Experiment
        Draws with the sizes of their errors: where climbs begin.
    readings : ndarray, shape (n, 2 or 4)
        As for `inference.identifiability.model_response.model_response`.
    z : ndarray, shape (d,)
        Median of the draws, moved by the response.
    log_r : ndarray, shape (n,)
        That of their ranges; nan for a frame without object.

    Returns
    -------
    (ndarray, ndarray)
        From those medians, shape (d,) and (n,); 0 for a frame without object.
    """
    best, least = None, math.inf
    starts = int(np.clip(_FRAMES // log_r.size, 1, min(_STARTS, len(experiments))))
    for i in np.linspace(0, len(experiments) - 1, starts).astype(np.intp):
        end, deviance = joint_optimum(experiments[i], readings)
        if deviance < least:
            best, least = end, deviance
    if best is None:
        return np.zeros(z.size), np.zeros(log_r.size)
    present = np.isfinite(best.log_r)
    off = np.where(present, best.log_r - log_r, 0.0)
    return best.z - z, off
