"""A maximum of the likelihood, and the way to it from a starting point."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.deviance import POSITION
from inference.fits.likelihood.levenberg_marquardt import levenberg_marquardt
from inference.fits.likelihood.polish import polish
from inference.fits.likelihood.problem import FitProblem

__all__ = ["DECIDED", "MANY", "TOP", "Maximum", "approach", "followed", "maximum_from"]

Array = NDArray[np.float64]

DECIDED = 9.0  # deviance by which something must be worse to be decided against: 3 sd
MANY = 100  # steps of Levenberg-Marquardt that reach the top as a rule
TOP = 1e-3  # deviance that may remain to be gained
_TURNS = 4  # of Newton steps and climbs


@dataclasses.dataclass(frozen=True, eq=False)
class Maximum:
    """A local maximum of the likelihood.

    Attributes
    ----------
    x : ndarray, shape (d,)
        Coordinates.
    deviance : float
        -2 log likelihood, relative to no residual under read noise alone.
    remaining : float
        Deviance that a whole Newton step would still gain: 0 at the top.
    positions : ndarray, shape (n,)
        log r of every frame; nan without an object.
    """

    x: Array
    deviance: float
    remaining: float
    positions: Array


def approach(problem: FitProblem, x: Array, steps: int) -> Maximum:
    """Climb from a point by Levenberg-Marquardt steps.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Start.
    steps : int
        At most so many.

    Returns
    -------
    Maximum
        As far as it went; its deviance is inf where the start has no likelihood.
    """
    place = problem.place(x)
    found = levenberg_marquardt(place, problem.kernel_fit(), steps)
    return Maximum(place.x, found.deviance, found.remaining, place.best[0, :, POSITION].copy())


def followed(problem: FitProblem, near: Maximum) -> Maximum:
    """Follow where the top is not reached: Newton steps, and the climb again from their end."""
    for _ in range(_TURNS):
        if not np.isfinite(near.deviance) or near.remaining <= TOP:
            break
        before = near.deviance
        near = Maximum(*polish(problem, near.x))
        if near.remaining <= TOP:
            break
        near = approach(problem, near.x, MANY)
        if before - near.deviance < TOP:
            break
    return near


def maximum_from(problem: FitProblem, x: Array) -> Maximum:
    """Climb from a point to the top.

    Parameters
    ----------
    x : ndarray, shape (d,)
        Start.

    Returns
    -------
    Maximum
        Its deviance is inf where the start has no likelihood.
    """
    return followed(problem, approach(problem, x, MANY))
