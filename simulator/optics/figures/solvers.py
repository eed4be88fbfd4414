"""The few equations of chapters 4 and 5 that their figures need, each by plain bracketing.

They are drawn, not offered: the estimators that answer requests live in the inference layer, on
which the simulator does not depend.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from simulator.object_model import distortion, object_flux

__all__ = ["background_cancelling", "conventional", "differential"]

Array = NDArray[np.float64]


def conventional(w1: Array, w2: Array, r0: float) -> Array:
    """Return r0 w1 / w2 (docs/model.md, 4.60) [m]."""
    return np.asarray(r0 * w1 / w2)


def differential(slope: Array, c0: float, c1: float) -> Array:
    """Return r with zeta(r) r = q, q = r0 dW1/dW2 (4.68) [m]; nan where there is none.

    Unique for c1 >= -1.633 sqrt(c0) (docs/model.md, 4.68).
    """

    def solve(q: float) -> float:
        if not q > 0:
            return math.nan
        # zeta lies between 1/4 and 1
        return float(brentq(lambda r: distortion(r, c0, c1) * r - q, 0.5 * q, 5.0 * q, rtol=1e-14))

    return np.array([solve(q) for q in slope.tolist()])


def background_cancelling(
    w1: Array, w2: Array, r0: float, background_m: float, strength: float, c0: float, c1: float
) -> Array:
    """Return r in (0, R) of 4.73 [m]; nan where D <= 0, which no object before R gives.

    Parameters
    ----------
    w1, w2 : ndarray
        Readings.
    r0, background_m : float
        c T_p / 2 and R [m].
    strength : float
        c0 c2 in the units of the readings.
    c0, c1 : float
        Object parameters.
    """

    def solve(first: float, second: float) -> float:
        net = second - r0 / background_m * first
        if not net > 0:
            return math.nan

        def excess(log_r: float) -> float:
            r = math.exp(log_r)
            return object_flux(r, strength, c0, c1) * (1 - r / background_m) - net

        low, high = math.log(1e-9 * background_m), math.log(background_m * (1 - 1e-15))
        return math.exp(brentq(excess, low, high, xtol=1e-14))

    return np.array([solve(a, b) for a, b in zip(w1.tolist(), w2.tolist(), strict=True)])
