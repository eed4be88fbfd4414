"""What an error of the clock does to an answer of which some ranges are known."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.identifiability.experiment import Experiment
from inference.identifiability.range_response import range_response
from inference.posterior.answer.widened import widened
from inference.posterior.criticism.discrepancy_check import MISFIT, LargerDiscrepancy

__all__ = ["where_known"]

Array = NDArray[np.float64]


def where_known(
    density: CollapsedDensity,
    experiments: Sequence[Experiment],
    readings: Array,
    size: float,
    larger: LargerDiscrepancy | None,
) -> tuple[Array, Array]:
    """Return how z and ranges, of which some are known, follow errors of the effective distance.

    Readings that demand larger errors than were stated pull known ranges apart: what they say of
    the errors' size, relative to the stated one, then widens the whole (Birge 1932).

    Parameters
    ----------
    density : CollapsedDensity
        Of the job.
    experiments : sequence of m Experiment
        Draws.
    readings : ndarray, shape (frames, 4)
        As for `range_response`.
    size : float
        Standard deviation of the error [m].
    larger : LargerDiscrepancy or None
        Where the flux's error was integrated out: what one twice as large would change.

    Returns
    -------
    (ndarray, ndarray)
        Shapes (m, d, 1 + k) and (m, frames, 1 + k), as `ErrorBudget` has them.
    """
    z, log_r = (np.array([getattr(each, name) for each in experiments]) for name in ("z", "log_r"))
    square, told = 0.0, 0.0
    if isinstance(density, DiscrepantDensity):
        centres, factors, _ = density.expansions(z)
        experiments = [
            dataclasses.replace(each, discrepancy=density.discrepancy, error=of, shadow=0.0)
            for each, of in zip(experiments, centres, strict=True)
        ]
        square += float(np.square(centres).sum())
        told += centres.size - float(np.square(np.linalg.inv(factors)).sum())
    found = [range_response(each, readings, size) for each in experiments]
    of_z, of_log_r = np.array([each[0] for each in found]), np.array([each[1] for each in found])
    if larger is None or not larger.bayes_factor > MISFIT:
        return of_z, of_log_r
    for *_, error in found:
        square += float(np.square(error.mean).sum())
        told += error.mean.size - float(np.square(error.spread).sum())
    wider = max(square / told, 1.0) if told > 0 else 1.0
    return _widened(z, of_z, log_r, of_log_r, wider)


def _widened(
    z: Array, of_z: Array, log_r: Array, of_log_r: Array, factor: float
) -> tuple[Array, Array]:
    """Multiply the variance of draws, and of what errors move them by, by a factor above 1."""
    found = []
    for of, part in zip((of_z, of_log_r), widened(z, log_r, factor), strict=True):
        moved = of.copy()
        moved[:, :, 1:] *= math.sqrt(factor)
        new = np.broadcast_to(part, (len(of), *part.shape))
        found.append(np.concatenate([moved, new], axis=2))
    return found[0], found[1]
