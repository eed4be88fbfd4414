"""Posterior predictive check: is the model able to make such readings at all."""

import numpy as np
from numpy.typing import NDArray

from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.posterior import Fit
from inference.posterior.ranges import replicate

__all__ = ["predictive_check"]

Array = NDArray[np.float64]

_MISFIT = 1e-3


def predictive_check(
    density: CollapsedDensity, z: Array, log_r: Array, rng: np.random.Generator
) -> Fit:
    """Compare the collapsed likelihood of the frames with that of readings drawn anew.

    The replicates share the ranges' draws, so the p-value leans towards one half and the false
    alarms are rarer than stated. One replicate a draw.

    Parameters
    ----------
    density : CollapsedDensity
        The density.
    z : ndarray, shape (m, d)
        Draws of the parameters.
    log_r : ndarray, shape (m, frames)
        Draws of the ranges given them.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Fit
    """
    anew = density.paired_log_likelihood(z, replicate(density, z, log_r, rng))
    seen = density.log_likelihood(z)
    p = float((np.sum(anew <= seen) + 0.5) / (len(z) + 1))
    return Fit(p, p < _MISFIT)
