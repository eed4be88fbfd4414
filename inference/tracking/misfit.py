"""Which frames say that scene, noise or motion are not as stated."""

import numpy as np
from numpy.typing import NDArray

from inference.tracking.report import (
    LASTING,
    OUTLIERS_RUN,
    PRESENT,
    STUCK,
    SURPRISE,
    UNSTEADY_MEAN,
)
from inference.tracking.rules import MisfitLimits

__all__ = ["misfits"]

Array = NDArray[np.float64]

# frames on end with the readings of the one before, an object being there, from which on a sensor
# is stuck, where rounding does not explain it (`hypotheses.stuck_for`)
_STUCK = 29


def misfits(
    out: Array, limits: MisfitLimits, crosstalk: Array | None, bounds: Array | None
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell of each frame whether a running mean, or learnt crosstalk, is beyond what may be.

    What lasts across the curve is of an object: where none is, it is remembered and not said. So
    are readings that do not change: a sensor may well read zero where nothing is.

    Parameters
    ----------
    out : ndarray, shape (n, `REPORT_COLUMNS`)
        The kernel's report.
    limits : MisfitLimits
        Of its running means.
    crosstalk : ndarray, shape (n, 2), or None
        What was learnt [reading units].
    bounds : ndarray, shape (2, 2), or None
        Least and largest that it is as its prior says [reading units].

    Returns
    -------
    (ndarray, ndarray) of bool, shape (n,)
        Whether any of these says so, and whether outliers come one after another.
    """
    misfit = out[:, SURPRISE] > limits.surprise
    misfit |= out[:, UNSTEADY_MEAN] > limits.unsteady
    misfit |= ((out[:, LASTING] > limits.lasting) | (out[:, STUCK] >= _STUCK)) & (
        out[:, PRESENT] > 0.5
    )
    if crosstalk is not None and bounds is not None:
        misfit |= ((crosstalk < bounds[:, 0]) | (crosstalk > bounds[:, 1])).any(axis=1)
    return misfit, out[:, OUTLIERS_RUN] >= limits.outliers
