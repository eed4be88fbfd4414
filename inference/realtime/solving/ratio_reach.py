"""How far noise moves a ratio of two readings: along the curve, where its tangent does not hold.

Where the lower one drowns, noise that makes it larger makes the ratio, and the tangent's error with
it, too small by much (docs/model.md, reach).
"""

import math

import numpy as np
from numpy.typing import NDArray

from simulator.compiled import compiled

__all__ = ["FEW", "ratio_ends", "ratio_reach", "ratio_reaches"]

Array = NDArray[np.float64]

FEW = 400.0
"""Squared signal over noise of the lower reading below which a ratio is followed: 20 of noise."""
_BAND = 3.0  # standard deviations of noise that are followed, as `assemble.NOISE_BAND`


@compiled
def _ends(
    ratio: float,
    var1: float,
    cov: float,
    var2: float,
    determinant: float,
    bottom: float,
    top: float,
    band: float,
) -> tuple[float, float]:
    """Return the ends of the ratios s that noise of ``band`` standard deviations explains.

    Those with ``(x - s y)² <= band² (var1 - 2 s cov + s² var2)`` (Fieller 1954), which go on for
    ever where y is within its noise of zero.

    Parameters
    ----------
    ratio : float
        x / y, readings in units of the lower one, y.
    var1, cov, var2, determinant : float
        Covariance of their noise in these units, and its determinant.
    bottom, top : float
        Between which a ratio lies.
    band : float
        Standard deviations.
    """
    few = band * band
    left, middle = 1.0 - few * var2, ratio - few * cov
    rest = ratio * ratio - few * var1
    first = var1 - 2.0 * ratio * cov + ratio * ratio * var2
    square = few * (first - few * determinant)
    if not square > 0.0:
        return -math.inf, math.inf
    # the sum in which nothing cancels is one root, and leads to the other
    total = middle + math.copysign(math.sqrt(square), middle)
    one, other = rest / total, total / left if left != 0.0 else math.copysign(math.inf, -total)
    low, high = min(one, other), max(one, other)
    if left > 0.0:
        return low, high
    # all but what lies between them
    if ratio <= low:
        return -math.inf, low if high > top else math.inf
    return high if low < bottom else -math.inf, math.inf


@compiled
def ratio_reach(
    late: float, whole: float, own1: float, own2: float, shared: float, end: float
) -> float:
    """Return the larger of the moves of late / whole by three standard deviations, over three.

    Parameters
    ----------
    late, whole : float
        Windows of a pulse, crosstalk subtracted; both positive.
    own1, own2, shared : float
        Variances of their noise, as `simulator.readings.noise_parts` has them.
    end : float
        Largest share that an object may have.

    Returns
    -------
    float
        [1]; shares below zero are none, nor are such above ``end``.
    """
    # in units of the whole window, so that no square of a reading overflows
    share = late / whole
    own1, own2, shared = own1 / whole / whole, own2 / whole / whole, shared / whole / whole
    determinant = own1 * own2 + shared * (own1 + own2)
    low, high = _ends(share, own1 + shared, shared, own2 + shared, determinant, 0.0, end, _BAND)
    return max(min(high, end) - share, share - max(low, 0.0), 0.0) / _BAND


@compiled
def ratio_reaches(x: Array, y: Array, var1: Array, cov: Array, var2: Array) -> Array:
    """Return the larger of the moves of ratios x / y by three standard deviations, over three.

    Parameters
    ----------
    x, y, var1, cov, var2 : ndarray, shape (n,)
        Readings of any sign, and the covariance of their noise.

    Returns
    -------
    ndarray, shape (n,)
        [1]; infinite where y may be zero, and nan where it is, or where the noise is not known.
    """
    reaches = np.empty(x.size)
    for i in range(x.size):
        if not abs(y[i]) > 0.0:
            reaches[i] = math.nan
            continue
        ratio = x[i] / y[i]
        a, b, c = var1[i] / y[i] / y[i], cov[i] / y[i] / y[i], var2[i] / y[i] / y[i]
        if math.isnan(a + b + c):
            reaches[i] = math.nan
            continue
        low, high = _ends(ratio, a, b, c, max(a * c - b * b, 0.0), -math.inf, math.inf, _BAND)
        reaches[i] = max(high - ratio, ratio - low) / _BAND
    return reaches


@compiled
def ratio_ends(
    x: Array, y: Array, var1: Array, cov: Array, var2: Array, band: float
) -> tuple[Array, Array]:
    """Return between which ratios x / y lie, if noise is below a number of standard deviations.

    Parameters
    ----------
    x, y, var1, cov, var2 : ndarray, shape (n,)
        As of `ratio_reaches`.
    band : float
        Standard deviations.

    Returns
    -------
    low, high : ndarray, shape (n,)
        [1]; infinite where y may be zero, and nan where it is, or where the noise is not known.
    """
    lows, highs = np.full(x.size, np.nan), np.full(x.size, np.nan)
    for i in range(x.size):
        if not abs(y[i]) > 0.0:
            continue
        ratio = x[i] / y[i]
        a, b, c = var1[i] / y[i] / y[i], cov[i] / y[i] / y[i], var2[i] / y[i] / y[i]
        if math.isnan(a + b + c):
            continue
        if a == 0.0 and c == 0.0:
            lows[i], highs[i] = ratio, ratio
            continue
        determinant = max(a * c - b * b, 0.0)
        low, high = _ends(ratio, a, b, c, determinant, -math.inf, math.inf, band)
        lows[i], highs[i] = min(low, ratio), max(high, ratio)
    return lows, highs
