"""Residuals, rank and Cramer-Rao bounds of a fit at one point."""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.problem import FitProblem
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information

__all__ = ["residuals_and_information"]

Array = NDArray[np.float64]


def residuals_and_information(
    problem: FitProblem, x: Array, positions: Array
) -> tuple[Array, Information]:
    """Linearise at given coordinates and ranges.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    positions : ndarray, shape (n,)
        log r of every frame; nan without an object.

    Returns
    -------
    (ndarray, Information)
        Whitened residuals, shape (n, 2), and the information in the fit's coordinates. A range at
        the end of its support counts as known.
    """
    n, d = problem.frames.shape[0], len(problem)
    jacobian, along, residual = np.empty((n, 2, d)), np.empty((n, 2)), np.empty((n, 2))
    positions = np.ascontiguousarray(positions)
    whitened_slopes(
        jacobian,
        along,
        residual,
        problem.values(x),
        problem.chain(x),
        positions,
        problem.kernel_fit(),
    )
    return residual, eliminate(problem.names, jacobian, along)
