"""Coordinates in which a fit moves: logarithms of what is positive, the shape of the objects.

Nothing depends on units in them: log c0, log(1 + c1 / (2 sqrt c0)), log c2, log of strength and
distance of the background, the same two for the shadow; crosstalk as it is, in units of the noise.
"""

import math

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.slopes import SLOTS
from simulator.compiled import compiled

__all__ = ["KNOWN", "SAME", "Layout", "bounds_of", "chain", "physical"]

Array = NDArray[np.float64]
# index of each slot's coordinate (KNOWN: a known number, SAME: the object's), known numbers, and
# the least and largest physical value of each slot
Layout = tuple[NDArray[np.int64], Array, Array, Array]

KNOWN, SAME = -1, -2
_TIGHTEST = -13.0  # log(1 + c1 / (2 sqrt c0)): a part in half a million above the poles


@compiled
def _shape(c0: float, x: float) -> float:
    return 2.0 * math.sqrt(c0) * math.expm1(x)


@compiled
def physical(values: Array, x: Array, layout: Layout) -> bool:
    """Fill the values of all slots; tell whether they are numbers.

    Parameters
    ----------
    values : ndarray, shape (at least SLOTS,)
        Filled.
    x : ndarray, shape (d,)
        Coordinates.
    layout : Layout
        Which slot is which coordinate.
    """
    index, known = layout[0], layout[1]
    for k in range(SLOTS):
        j = index[k]
        if j == KNOWN:
            values[k] = known[k]
        elif j == SAME:
            values[k] = values[k - 7]
        elif k == 3 or k == 4:
            values[k] = x[j]
        elif k == 1 or k == 8:
            values[k] = _shape(values[k - 1], x[j])
        else:
            values[k] = math.exp(x[j])
    good = values[0] > 0.0 and values[2] > 0.0
    for k in range(SLOTS):
        good = good and math.isfinite(values[k])
    return bool(good)


@compiled
def bounds_of(low: Array, high: Array, values: Array, layout: Layout) -> None:
    """Fill the least and largest value of each coordinate.

    Parameters
    ----------
    low, high : ndarray, shape (d,)
        Filled.
    values : ndarray
        From `physical`: the bounds of a shape c1 move with c0.
    layout : Layout
        Which slot is which coordinate.
    """
    index, _, least, largest = layout
    for k in range(SLOTS):
        j = index[k]
        if j < 0:
            continue
        if k == 3 or k == 4:
            low[j], high[j] = least[k], largest[k]
        elif k == 1 or k == 8:
            root = 2.0 * math.sqrt(values[k - 1])
            low[j], high[j] = _TIGHTEST, math.inf
            if least[k] > root * math.expm1(_TIGHTEST):
                low[j] = math.log1p(least[k] / root)
            if largest[k] < math.inf:
                high[j] = max(math.log1p(max(largest[k] / root, -1.0 + 1e-15)), low[j])
        else:
            low[j] = math.log(least[k]) if least[k] > 0.0 else -math.inf
            high[j] = math.log(largest[k])


@compiled
def chain(out: Array, values: Array, x: Array, layout: Layout, low: Array, high: Array) -> None:
    """Fill the derivative of every slot along every coordinate.

    Parameters
    ----------
    out : ndarray, shape (SLOTS, d)
        Filled.
    values, x, layout, low, high
        From and for `physical` and `bounds_of`.
    """
    index = layout[0]
    out[:] = 0.0
    for k in range(SLOTS):
        j = index[k]
        if j == SAME:
            for i in range(out.shape[1]):
                out[k, i] = out[k - 7, i]
        elif j >= 0:
            if k == 3 or k == 4:
                out[k, j] = 1.0
            elif k == 1 or k == 8:
                out[k, j] = values[k] + 2.0 * math.sqrt(values[k - 1])
                # a c1 that its own bound holds does not move with c0
                held = x[j] <= low[j] or x[j] >= high[j]
                if not held:
                    for i in range(out.shape[1]):
                        out[k, i] += 0.5 * values[k] / values[k - 1] * out[k - 1, i]
            else:
                out[k, j] = values[k]
