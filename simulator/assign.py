"""Assignment of one array to another inside kernels.

To ``a[:] = b`` numba compiles the text of the error that shapes could raise, which costs two
seconds for every number of dimensions; a loop costs none of them.
"""

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["assign"]


@compiled
def assign(into: NDArray[np.float64], of: NDArray[np.float64]) -> None:
    """Put every element of an array into another of the same shape."""
    for k in range(of.size):
        into.flat[k] = of.flat[k]
