"""What tests of whole tracks share."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SNR_100 = 7.72e-5  # noise at which the plate at 1 m has a signal-to-noise ratio of 100

NORMAL = {"prior": "normal", "mean": 0.0}


def off(result: Any, u: Array) -> Array:
    """Errors of the best ranges in units of their standard deviation."""
    return np.asarray((np.log(result.best_m) - u) * result.best_m / result.best_sd_m)
