"""Where readings before a background are met best with errors of the model."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.discrepant import DiscrepantDensity
from inference.density.static import StaticDensity
from inference.frame.blocks import DISPLACEMENT, RANGE
from inference.frame.known_range import rates_of
from inference.frame.warmth import gains_of
from inference.identifiability.experiment import Experiment
from inference.posterior.answer.shadow_beside import with_shadow
from inference.posterior.answer.where_bent import best_end
from simulator.model_error import ModelError

__all__ = ["BestPoint", "best_point"]

Array = NDArray[np.float64]

_DRAWS = 4
_REACH = 0.01  # share of the draws on each side that is as good as none


class BestPoint(NamedTuple):
    """Unknowns, ranges and errors that meet readings best.

    Attributes
    ----------
    point : Experiment
        With its errors.
    readings : ndarray, shape (n, 2 or 4)
        Of the frames, and range and displacement [m] where they are known beside them.
    """

    point: Experiment
    readings: Array


def best_point(
    density: CollapsedDensity, z: Array, log_r: Array, error: ModelError, answered: Array
) -> BestPoint | None:
    """Seek the point from which to follow errors of flux and shadow, beginning at draws.

    Parameters
    ----------
    density : CollapsedDensity
        Of the frames.
    z : ndarray, shape (m, d)
        Draws of the posterior.
    log_r : ndarray, shape (m, n)
        Their ranges; nan for a frame without object.
    error : ModelError
        Sizes of the errors.
    answered : ndarray, shape (any, n)
        Log ranges of the answer, moved by the errors of the model.

    Returns
    -------
    BestPoint or None
        None where nothing casts a shadow, and where the answer does not reach its ranges: then
        the answer is another one.
    """
    shadow = error.shadow if density.parameters.has_background else 0.0
    if not shadow > 0 or isinstance(density, StaticDensity) or not len(z):
        return None
    rates = rates_of(density.frames)
    readings = density.frames[:, [0, 1] if rates is None else [0, 1, RANGE, DISPLACEMENT]]
    integrated = isinstance(density, DiscrepantDensity)
    experiments = [
        Experiment(
            density.sensor,
            density.parameters,
            z[i],
            log_r[i],
            gains_of(density.frames),
            discrepancy=None if integrated else error.flux or None,
            shadow=0.0 if integrated else shadow,
            rates=rates,
        )
        for i in np.linspace(0, len(z) - 1, min(_DRAWS, len(z))).astype(np.intp)
    ]
    if isinstance(density, DiscrepantDensity):
        experiments = with_shadow(density, experiments, shadow)
    best = best_end(experiments, readings)
    if best is None:
        return None
    present = np.isfinite(best.log_r)
    low, high = np.quantile(answered[:, present], [_REACH, 1.0 - _REACH], axis=0)
    there = best.log_r[present]
    if np.any((there < low) | (there > high)):
        return None
    return BestPoint(best, readings)
