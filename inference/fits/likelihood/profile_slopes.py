"""The gradient of the deviance, ranges eliminated."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import Bounds, Fit, Place
from inference.fits.likelihood.deviance import deviance
from inference.fits.likelihood.linearisation import fill_projected
from simulator.compiled import compiled, hot

__all__ = ["profile_slopes"]

Array = NDArray[np.float64]


@hot
@compiled
def profile_slopes(matrix: Array, place: Place, fit: Fit) -> float:
    """Return the deviance with every range at its best, and fill its projected rows.

    Their product with the residuals is minus half the gradient, to second order in what the
    ranges' best values lack.

    Parameters
    ----------
    matrix : ndarray, shape (`linearisation.rows_of` the frames, d + 1)
        Filled as by `linearisation.fill_projected`.
    place : Place
        Its coordinates, within their bounds, are read; the rest is filled.
    fit : Fit
        The fit.
    """
    value = deviance(place, fit)
    if math.isfinite(value):
        d = place.x.size
        fill_projected(matrix, place, Bounds(np.empty(d), np.empty(d)), fit)
    return value
