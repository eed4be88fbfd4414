"""Errors that frames share, in as few numbers as the readings can tell from one another."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["fewer"]

Array = NDArray[np.float64]

# of the noise of one reading: what all readings together show less of changes no bound that is told
_UNSEEN = 1e-3


def fewer(errors: Array) -> Array:
    """Return shared errors in as many coordinates as count.

    A smooth error has dozens of coefficients over all ranges that there can be, of which few frames
    on a short way tell some. The coefficients are turned, which leaves them independent and
    standard normal, so that all that readings see of them is in the first.

    Parameters
    ----------
    errors : ndarray, shape (n, m, k)
        Whitened derivatives of the readings along independent standard normal errors.

    Returns
    -------
    ndarray, shape (n, m, j)
        Likewise, without those that move all readings by less than a thousandth of their noise.
    """
    if errors.size == 0:
        return errors
    rows = errors.reshape(-1, errors.shape[2])
    # of the triangular factor, not of the product: small ones keep their digits beside large ones
    _, sizes, turn = np.linalg.svd(np.linalg.qr(rows, mode="r"), full_matrices=False)
    return np.asarray(errors @ turn[sizes > _UNSEEN].T)
