"""Whether what a fit leaves goes on from frame to frame, or scatters less than its noise lets it.

Both are signs of readings that a sensor or its driver has smoothed over frames, by a low-pass or a
running mean. Their ranges are those of the past: late, and as sure as the noise that is stated
(docs/model.md, succession).
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.erring import Erring
from inference.fits.likelihood.erring_point import linearised
from inference.identifiability.elimination import eliminate

__all__ = ["goes_on", "scatters_less"]

Array = NDArray[np.float64]

_FEWEST = 3.0  # directions left free, of which fewer tell of no succession


def goes_on(left: Array, followed: Array, frames: NDArray[np.intp]) -> float:
    """Return how often what independent noise leaves goes on so from one frame to the next.

    What is left of a row is multiplied by what is left of the same row of the next frame. Of
    independent noise of any size, with what the fit follows projected out, the mean of that over
    the squares is known, and its variance (Durbin and Watson 1950); the law is taken as normal.

    Parameters
    ----------
    left : ndarray, shape (m,)
        Of the rows of readings.
    followed : ndarray, shape (m, d)
        Those rows of an orthonormal basis of all that was fitted.
    frames : ndarray of int, shape (m,)
        Of which frame each row is.

    Returns
    -------
    float
        1 of too few rows.
    """
    free = left.size - float(np.square(followed).sum())
    square = float(left @ left)
    first, second = _successive(frames)
    if free < _FEWEST or not first.size or not square > 0.0:
        return 1.0

    def paired(part: Array) -> Array:
        out = np.zeros_like(part)
        out[first] += 0.5 * part[second]
        out[second] += 0.5 * part[first]
        return out

    # A the pairs, without a diagonal, C = 1 - Q Q^T what the fit leaves: tr(A C) = -tr(Q^T A Q)
    moved = paired(followed)
    within = followed.T @ moved
    mean = -float(np.trace(within)) / free
    # tr((A - mean) C (A - mean) C)
    turned = moved - mean * followed
    kept = 0.5 * first.size + mean * mean * left.size
    kept -= 2.0 * float(np.square(turned).sum())
    kept += float(np.square(within - mean * (followed.T @ followed)).sum())
    if not kept > 0.0:
        return 1.0
    off = float(left @ paired(left)) / square - mean
    return float(scipy.special.ndtr(-off * math.sqrt(free * (free + 2.0) / (2.0 * kept))))


def _successive(frames: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of rows that are the same one, of as many, of a frame and of the next."""
    order = np.argsort(frames, kind="stable")
    number = np.bincount(frames)
    begin = np.cumsum(number) - number
    each = np.flatnonzero((number[:-1] == number[1:]) & (number[:-1] > 0))
    rows = [order[begin[k] + np.arange(number[k])] for k in each]
    then = [order[begin[k + 1] + np.arange(number[k])] for k in each]
    none = [np.empty(0, dtype=np.intp)]
    return np.concatenate(none + rows), np.concatenate(none + then)


def scatters_less(top: Erring, freedom: float) -> float:
    """Return how often frames scatter as little about a fit by the noise that is stated.

    What errors leave of each frame is no part of it: beside that, bright frames scatter less as a
    rule.

    Parameters
    ----------
    top : Erring
        The best maximum.
    freedom : float
        How much of the rows of readings the fit leaves free.
    """
    residual, jacobian, along, _, _ = linearised(top.clean, top.x, top.positions)
    seen = eliminate(top.clean.names, jacobian, along, residual[:, :, None])
    square = float(np.square(seen.errors).sum())
    return float(scipy.special.chdtr(freedom, square)) if freedom > 0.0 else 1.0
