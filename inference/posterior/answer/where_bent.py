"""What draws of an exact model owe to their branch where errors of the model bend the response."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from inference.identifiability.joint_optimum import joint_optimum

__all__ = ["End", "best_ends", "where_bent"]

Array = NDArray[np.float64]

_REACH = 0.01  # share of the draws on each side that is as good as none
_STARTS, _FRAMES = 4, 2400  # climbs, and frames of all of them


class End(NamedTuple):
    """Where a climb over unknowns, ranges and errors ends, and its deviance."""

    point: Experiment
    deviance: float


def best_ends(experiments: Sequence[Experiment], readings: Array) -> list[End]:
    """Seek the best point of unknowns, ranges and errors together from some draws.

    Parameters
    ----------
    experiments : sequence of Experiment
        Draws with the sizes of their errors: where climbs begin.
    readings : ndarray, shape (n, 2 or 4)
        As for `inference.identifiability.model_response.model_response`.

    Returns
    -------
    list of End
        By ascending deviance; those that are numbers.
    """
    frames = experiments[0].log_r.size
    starts = int(np.clip(_FRAMES // frames, 1, min(_STARTS, len(experiments))))
    ends = [
        End(*joint_optimum(experiments[i], readings))
        for i in np.linspace(0, len(experiments) - 1, starts).astype(np.intp)
    ]
    return sorted((end for end in ends if np.isfinite(end.deviance)), key=lambda end: end.deviance)


def where_bent(ends: Sequence[End], z: Array, log_r: Array) -> tuple[Array, Array]:
    """Return how far the best point of unknowns, ranges and errors together lies from the draws.

    An exact model may hold a narrow branch of its posterior for improbable beside a wide one that
    fits no better. Errors widen the narrow one, and no draw is there to follow them.

    Parameters
    ----------
    ends : sequence of End
        From `best_ends`.
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
    if not ends or log_r.shape[1] <= z.shape[1]:
        return off_z, off
    best = ends[0].point
    present = np.isfinite(best.log_r)
    low, middle, high = np.quantile(log_r[:, present], [_REACH, 0.5, 1.0 - _REACH], axis=0)
    there = best.log_r[present]
    if not np.any((there < low) | (there > high)):
        return off_z, off
    off[present] = there - middle
    return best.z - np.median(z, axis=0), off
