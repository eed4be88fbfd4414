"""What draws are moved by where readings ask for errors of the flux larger than a scene allows.

Draws of a model that the readings refute lie where that model meets them best, which is not where
larger errors put them: so all are moved to the best point with errors of that size, and by one more
error as large as the way there.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.experiment import Experiment
from inference.posterior.answer.where_bent import best_end, where_bent
from inference.posterior.answer.widened import widened

__all__ = ["where_integrated", "where_misfit"]

Array = NDArray[np.float64]


def where_misfit(
    experiments: Sequence[Experiment], readings: Array, moved_z: Array, moved_log_r: Array
) -> tuple[Array, Array]:
    """Return how draws move to the best point with errors as large as readings ask for.

    Parameters
    ----------
    experiments : sequence of Experiment
        Draws with errors of that size.
    readings : ndarray, shape (frames, 2 or 4)
        As for `best_end`.
    moved_z, moved_log_r : ndarray, shape (n, d) and (n, frames)
        Draws, moved by the response to such errors.

    Returns
    -------
    (ndarray, ndarray)
        Shapes (d, 2) and (frames, 2): a constant, and an independent error as large.
    """
    found = where_bent(best_end(experiments, readings), moved_z, moved_log_r)
    of_z, of_log_r = (np.stack([way, way], axis=1) for way in found)
    return of_z, of_log_r


def where_integrated(
    density: DiscrepantDensity,
    experiments: Sequence[Experiment],
    readings: Array,
    draws: tuple[Array, Array],
    times: float,
) -> tuple[Array, Array]:
    """Return the same of draws of which errors of a smaller size were integrated out.

    Their variance, of which these errors make most where they matter, grows by the square of what
    the size does.

    Parameters
    ----------
    experiments : sequence of Experiment
        Draws.
    draws : (ndarray, ndarray), shapes (n, d) and (n, frames)
        All of them.
    times : float
        By what larger errors are asked for.

    Returns
    -------
    (ndarray, ndarray)
        Shapes (d, 2 + k) and (frames, 2 + k).
    """
    z = np.array([each.z for each in experiments])
    centres, _, _ = density.expansions(z)
    larger = [
        dataclasses.replace(each, discrepancy=times * density.discrepancy, error=of / times)
        for each, of in zip(experiments, centres, strict=True)
    ]
    found = where_misfit(larger, readings, *draws)
    of_z, of_log_r = (
        np.concatenate([way, more], axis=1)
        for way, more in zip(found, widened(*draws, times**2), strict=True)
    )
    return of_z, of_log_r
