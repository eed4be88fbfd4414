"""Why a frame of a track has the status none, in words."""

import numpy as np
from numpy.typing import NDArray

from inference.estimates import Status

__all__ = ["REASONS", "reason_codes"]

REASONS = (
    "",
    "no object: the frame is stated to hold none, or the scene looks empty",
    "the scene looks empty, but an object may be there that is too faint, or rests beside light "
    "that may be its own",
    "an outlier: neither an object as stated nor an empty scene explains the readings",
    "an object is there, and no range of it is known yet",
    "the readings say nothing without the temperature of the sensor",
)
"""Reasons; the first, which says nothing, is that of every other status."""

_HARDLY = 0.05  # probability of an object below which the scene looks empty
_EVEN = 0.5  # probability from which on something is likelier than not


def reason_codes(
    status: NDArray[np.uint8],
    present: NDArray[np.float64],
    outlier: NDArray[np.float64],
    hypotheses: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    """Return which of `REASONS` holds of each frame.

    Parameters
    ----------
    status : ndarray of uint8, shape (n,)
        `Status`.
    present, outlier : ndarray, shape (n,)
        Probabilities that an object is there, and that readings have nothing to do with the scene.
    hypotheses : ndarray of uint8, shape (n,)
        How many ranges are followed.

    Returns
    -------
    ndarray of uint8, shape (n,)
    """
    # of an object that is likelier than none, and followed, a frame that is read has a range
    seen = np.where(hypotheses > 0, np.uint8(5), np.uint8(4))
    empty = np.where(present >= _HARDLY, np.uint8(2), np.uint8(1))
    code = np.where(present >= _EVEN, seen, empty)
    code = np.where(outlier > _EVEN, np.uint8(3), code)
    return np.where(status == Status.NONE, code, np.uint8(0)).astype(np.uint8)
