"""What the interpreter runs in the place of `inference.frame.dark_mass`: the same bits."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.frame.dark_mass import _NONE, DARK_MASS
from inference.frame.light_by_arrays import NotByArraysError, of_each
from inference.frame.range_prior import LEAST_INFORMATION
from inference.frame.table import LOG_PRIOR, LOG_RANGE

__all__ = ["_darken"]

Array = NDArray[np.float64]


def _darken(table: Array, flat: float) -> Any:
    """Return the law in the dark, and give it to a table where the law there is one."""
    try:
        share = of_each(math.exp, flat - table[LOG_PRIOR])
        width = table[LOG_RANGE, 1:] - table[LOG_RANGE, :-1]
        # a running sum, which rounds as the loop does
        mass = np.add.accumulate(0.5 * width * (share[1:] + share[:-1]))[-1]
        mass *= math.sqrt(LEAST_INFORMATION)
        if not mass > DARK_MASS:
            return 1.0
        dark = DARK_MASS / mass
        some = share > _NONE
        of_some = share[some]
        table[LOG_PRIOR, some] += of_each(math.log1p, (dark - 1.0) * of_some * of_some)
    except NotByArraysError:
        return NotImplemented
    return dark
