"""What errors of a window do to the direction of its derivative, beyond first order."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.realtime.net import Net
from simulator.compiled import compiled

__all__ = ["grown", "level_turns"]

Array = NDArray[np.float64]

_BAND = 3.0  # standard deviations of the noise to which a direction is followed
_ALONG = 5.0  # standard deviations above which a change is none of the noise that points its way


@compiled
def grown(square: float, across: float, along: float, both: float) -> float:
    """Return by how much noise along a change makes its direction less sure; inf where unsure.

    A direction is possible whose normal n has (n d)^2 <= 9 n' C n (Fieller 1954). Noise that is
    equal either way is followed so by whoever reads the direction; a common error of the readings,
    which points along them, alone turns a slow change towards them, and at rest is all there is.

    Parameters
    ----------
    square : float
        Squared length of the change.
    across, along, both : float
        Variances of the noise across the change and along it, and their covariance.
    """
    excess = along - across
    if square <= _ALONG * _ALONG * excess:
        return math.inf
    k = _BAND * _BAND
    plain = square - k * across
    left = plain - k * max(excess, 0.0)
    if plain <= 0.0 or across <= 0.0:
        return 1.0
    if left <= 0.0:
        return math.inf
    widest = k * abs(both) + math.sqrt(k * k * both * both + left * k * across)
    return max(widest / left / math.sqrt(k * across / plain), 1.0)


@compiled
def level_turns(
    net: Net,
    turns: Array,
    products: Array,
    rates: tuple[Array, Array],
    spread: tuple[Array, Array, Array],
) -> None:
    """Widen derivatives whose bias is said to turn them much less than that of their neighbours.

    The bias is told by two differences, either of which passes through zero somewhere on a smooth
    way; it does not do so at three frames on end. So each is taken to be turned by no less than the
    root of the mean square of its own estimate and those beside it, as far as its window goes.

    Parameters
    ----------
    net : Net
        Readings of the n frames and their noise.
    turns : ndarray, shape (n,)
        By how much the bias turns the derivative of each frame [rad], in units of the noise.
    products : ndarray, shape (n,)
        Product of the distances in each window [s^4]; 0 where there is no window.
    rates : (ndarray, ndarray)
        Derivatives, each of shape (n,).
    spread : (ndarray, ndarray, ndarray)
        Their variances and covariance, each of shape (n,); widened in place.
    """
    n = turns.size
    for i in range(n):
        if products[i] <= 0.0:
            continue
        squares, count = 0.0, 0
        for j in range(max(i - 1, 0), min(i + 2, n)):
            if products[j] > 0.0 and turns[j] < math.inf:
                shared = turns[j] * min(products[i] / products[j], 1.0)
                squares, count = squares + shared * shared, count + 1
        more = squares / max(count, 1) - turns[i] * turns[i]
        if more > 0.0:
            # across the derivative, where both readings have the same noise
            s1, s2 = math.sqrt(net.var1[i]), math.sqrt(net.var2[i])
            x, y = rates[1][i] / s2 * s1, rates[0][i] / s1 * s2
            spread[0][i] += more * x * x
            spread[1][i] += more * y * y
            spread[2][i] -= more * x * y
