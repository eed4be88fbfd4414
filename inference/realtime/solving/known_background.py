"""What background intensity is solved with and what it fills, as kernels take it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Found", "KnownBackground"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class KnownBackground(NamedTuple):
    """A background of which everything is known, in one unit of length.

    Attributes
    ----------
    strength : float
        Reading of the bare background.
    distance : float
        Its distance R.
    c0, c1 : float
        The shadow's parameters c0', c1'.
    """

    strength: float
    distance: float
    c0: float
    c1: float


class Found(NamedTuple):
    """Results of n frames with room for m roots each, filled from the left.

    Attributes
    ----------
    roots, sds : ndarray, shape (n, m)
        Ranges and their first-order standard deviations by noise; nan where there is none.
    late : ndarray, shape (n, m)
        Change of the root by an error of the object's effective distance (docs/model.md,
        model-error).
    near : ndarray of bool, shape (n, m)
        Whether noise reaches the fold beside the root.
    near_frame : ndarray of bool, shape (n,)
        Whether noise reaches any fold.
    physical : ndarray of bool, shape (n, m)
        Whether object and background are not negative beyond noise.
    """

    roots: Array
    sds: Array
    late: Array
    near: Flags
    near_frame: Flags
    physical: Flags
