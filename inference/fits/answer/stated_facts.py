"""Facts that a scene states in numbers: whether the frames tell others.

Chi-square is of all that is left, and a fact that is wrong is a small part of it. Looked at by
itself it may be told though chi-square is small (docs/model.md, stated-facts).
"""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import SLOTS
from inference.fits.likelihood.coordinates import KNOWN
from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import Told
from inference.frame.sensitivity import Value

__all__ = ["FREE", "along_brightness", "off_their_own", "weights_of_told"]

Array = NDArray[np.float64]

FREE = 0.05  # least share of its variance that the fit leaves of a direction that is looked at
_MANY = 300  # rows of which the directions are found in next to no time


def along_brightness(problem: FitProblem, x: Array, u: Array) -> Array:
    """Return how readings change with the whole light of an object whose c2 is a number.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x, u : ndarray, shape (d,), (n,)
        Coordinates, and log r; nan without an object.

    Returns
    -------
    ndarray, shape (n, 2, 1)
        In units of the noise; (n, 2, 0) where nothing is said of that light.
    """
    if problem.layout.coordinate[Value.C2] != KNOWN or not problem.present.any():
        return np.empty((u.size, 2, 0))
    slopes, along, residual = np.empty((u.size, 2, 1)), np.empty((u.size, 2)), np.empty((u.size, 2))
    c2 = np.zeros((SLOTS, 1))
    c2[Value.C2] = 1.0
    fit = problem.kernel_fit()
    whitened_slopes(slopes, along, residual, problem.opened(x)[0], c2, np.ascontiguousarray(u), fit)
    return np.where(np.isfinite(u)[:, None, None], slopes, 0.0)


def weights_of_told(along: Array, told: Told) -> Array:
    """Return how much of each row beside the readings is what is told of a range.

    Of `free_of_range`: its first row weighs readings against what is told, its second what is told
    twice.

    Parameters
    ----------
    along : ndarray, shape (n, 2)
        Whitened derivative of the readings along log r; nan without an object.
    told : Told
        What is known of the ranges there.

    Returns
    -------
    ndarray, shape (n, 2)
        From 0, where it tells all of the range or nothing, to 1.
    """
    read = np.linalg.norm(np.where(np.isfinite(along), along, 0.0), axis=1)
    size = np.linalg.norm(told.along, axis=1)
    whole = np.hypot(read, size)
    share = np.divide(read, whole, out=np.zeros_like(read), where=(whole > 0.0) & (size > 0.0))
    return np.column_stack([share, (told.along > 0.0).all(axis=1)])


def off_their_own(left: Array, followed: Array, weights: Array) -> tuple[float, int]:
    """Return how far what is told of ranges lies off a fit, as its own errors let it.

    Parameters
    ----------
    left : ndarray, shape (m,)
        What the fit leaves of rows of unit variance.
    followed : ndarray, shape (m, d)
        Those rows of an orthonormal basis of all that was fitted.
    weights : ndarray, shape (m,)
        From `weights_of_told`; 0 of rows of readings.

    Returns
    -------
    (float, int)
        A sum of squares, and of how many independent standard normal numbers it is where each
        errs as it says.
    """
    variance = np.square(weights) * (1.0 - np.square(followed).sum(axis=1))
    rows = np.argsort(-variance, kind="stable")[:_MANY]
    rows = rows[weights[rows] > 0.0]
    scaled = weights[rows, None] * followed[rows]
    share, turn = np.linalg.eigh(np.diag(np.square(weights[rows])) - scaled @ scaled.T)
    free = share > FREE
    off = turn[:, free].T @ (weights[rows] * left[rows]) / np.sqrt(share[free])
    return float(off @ off), off.size
