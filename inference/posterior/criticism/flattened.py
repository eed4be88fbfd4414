"""Means of draws by heavy weights: flattened until enough draws count, and continued from there.

Where a law reaches further than the draws do, a few of them in the tail hold all of its weights.
By weights to a smaller power means move by less, and that is known: it is continued in proportion,
twice as far at most.
"""

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = ["Flattened", "flattened"]

Array = NDArray[np.float64]

_COUNT = 0.3  # of the draws, that an effective size has to reach
_FURTHER = 2.0  # times as far as weights move means, beyond which nothing is continued


class Flattened(NamedTuple):
    """Weights of draws, and how far what they move is to be continued.

    Attributes
    ----------
    weights : ndarray, shape (n,)
        They sum to one.
    further : float
        Times as far as they move it a quantity moves.
    """

    weights: Array
    further: float

    def moved(self, values: Array) -> Array:
        """Return by how much means move, shape (k,), of values of shape (n, k)."""
        return np.asarray(self.further * (self.weights @ values - values.mean(axis=0)))


def flattened(log_weights: Array) -> Flattened:
    """Flatten weights.

    Parameters
    ----------
    log_weights : ndarray, shape (n,)
        At least one of them finite.
    """
    finite = log_weights[np.isfinite(log_weights)]
    spread = float(np.ptp(finite))

    def surplus(reach: float) -> float:
        weights = scipy.special.softmax(reach / spread * finite)
        return float(1.0 / np.sum(weights**2)) - _COUNT * len(finite)

    power = 1.0
    # weights within a factor e of one another count for nine tenths
    if spread > 1.0 and surplus(spread) < 0:
        power = float(scipy.optimize.brentq(surplus, 1.0, spread)) / spread
    return Flattened(scipy.special.softmax(power * log_weights), min(1.0 / power, _FURTHER))
