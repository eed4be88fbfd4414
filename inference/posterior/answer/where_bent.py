"""What draws of an exact model owe to their branch where errors of the model bend the response."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum

__all__ = ["best_end", "where_bent"]

Array = NDArray[np.float64]

_REACH = 0.01  # share of the draws on each side that is as good as none
_STARTS, _FRAMES = 4, 2400  # climbs, and frames of all of them
_FIRST = 60  # steps of each


def best_end(experiments: Sequence[Experiment], readings: Array) -> Experiment | None:
    """Seek the best point of unknowns, ranges and errors together from some draws.

    Climbs of bent valleys go on for hundreds of steps that gain little each: after the first part
    only the best goes on.

    Parameters
    ----------
    experiments : sequence of Experiment
        Draws with the sizes of their errors: where climbs begin.
    readings : ndarray, shape (n, 2 or 4)
        As for `inference.identifiability.model_response.model_response`.

    Returns
    -------
    Experiment or None
        None where no climb ends at a number.
    """
    frames = experiments[0].log_r.size
    starts = int(np.clip(_FRAMES // frames, 1, min(_STARTS, len(experiments))))
    first = [
        joint_optimum(experiments[i], readings, _FIRST)
        for i in np.linspace(0, len(experiments) - 1, starts).astype(np.intp)
    ]
    best, deviance = min(first, key=lambda end: end[1])
    return joint_optimum(best, readings)[0] if math.isfinite(deviance) else None


def where_bent(best: Experiment | None, z: Array, log_r: Array) -> tuple[Array, Array]:
    """Return how far the best point of unknowns, ranges and errors together lies from the draws.

    An exact model may hold a narrow branch of its posterior for improbable beside a wide one that
    fits no better. Errors widen the narrow one, and no draw is there to follow them.

    Parameters
    ----------
    best : Experiment or None
        From `best_end`.
    z : ndarray, shape (m, d)
        Draws, moved by the response.
    log_r : ndarray, shape (m, n)
        Their ranges; nan for a frame without object.

    Returns
    -------
    (ndarray, ndarray)
        From the medians of the draws, shape (d,) and (n,); 0 for a frame without object, and
        everywhere where draws reach as far as all ranges of that point: they know its branch.
    """
    off_z, off = np.zeros(z.shape[1]), np.zeros(log_r.shape[1])
    if best is None or log_r.shape[1] <= z.shape[1]:
        return off_z, off
    present = np.isfinite(best.log_r)
    low, middle, high = np.quantile(log_r[:, present], [_REACH, 0.5, 1.0 - _REACH], axis=0)
    there = best.log_r[present]
    if not np.any((there < low) | (there > high)):
        return off_z, off
    off[present] = there - middle
    return best.z - np.median(z, axis=0), off
