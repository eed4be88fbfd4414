"""What u and crosstalk err in common, kept apart from what u errs alone.

Crosstalk that is not known moves range and crosstalk together, along the line on which the readings
stay as they are. Seen from one frame after the other, that line is tangential to the curve at
another u each time, by the noise: an extended Kalman filter takes the turns between the tangents
for knowledge and soon believes that it knows both, as in simultaneous localisation and mapping
(Julier and Uhlmann 2001; Huang, Mourikis and Roumeliotis 2010). Here the error of u is divided into
what follows the crosstalk's error and the rest. Along the rest the curve is what it is. Along the
common part it is straight, its tangent taken at an anchor. What an update corrects, and what a rate
moves that may be noise, turns the tangent with the errors of the readings kept: no knowledge comes
from it. What is motion for certain turns it with the errors of the crosstalk kept, and that is how
motion tells range and crosstalk apart.
"""

import numpy as np
from numpy.typing import NDArray

from inference.tracking.curve import Curve, mean_at
from simulator.compiled import compiled

__all__ = ["ANCHOR", "certainty", "follow", "shared_part", "straighten", "turn_of"]

Array = NDArray[np.float64]
Pair = tuple[float, float]

ANCHOR = 4  # column of x where crosstalk is learnt: log r at which tangents are taken
_MOST = 0.5  # of the common part that a change of tangent may take up
_SINGULAR = 1e-14  # of a determinant against the product of its diagonal


@compiled
def shared_part(X: Array, row: int, n: int) -> tuple[float, float, float]:
    """Return how u follows the crosstalk, and the share of its variance that does.

    Parameters
    ----------
    X : ndarray, shape (rows, n, n + p)
        Roots of covariances; the first n columns count.
    row, n : int
        The hypothesis, and its number of states.

    Returns
    -------
    (float, float, float)
        Regression of u on the two crosstalk readings, and the share of its variance.
    """
    uu, u1, u2, k11, k12, k22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(n):
        u, first, second = X[row, 0, j], X[row, 2, j], X[row, 3, j]
        uu += u * u
        u1 += u * first
        u2 += u * second
        k11 += first * first
        k12 += first * second
        k22 += second * second
    determinant = k11 * k22 - k12 * k12
    if determinant > _SINGULAR * k11 * k22:
        back1 = (k22 * u1 - k12 * u2) / determinant
        back2 = (k11 * u2 - k12 * u1) / determinant
    elif k11 >= k22 and k11 > 0.0:
        back1, back2 = u1 / k11, 0.0
    elif k22 > 0.0:
        back1, back2 = 0.0, u2 / k22
    else:
        return 0.0, 0.0, 0.0
    share = (back1 * u1 + back2 * u2) / uu if uu > 0.0 else 0.0
    return back1, back2, min(max(share, 0.0), 1.0)


@compiled
def certainty(x: Array, X: Array, row: int) -> float:
    """Return how much of a rate is motion rather than noise, from 0 to 1."""
    variance = 0.0
    for j in range(X.shape[1]):
        variance += X[row, 1, j] * X[row, 1, j]
    square = x[row, 1] * x[row, 1]
    return square / (square + variance) if square > 0.0 else 0.0


@compiled
def turn_of(back: Pair, first: float, second: float) -> Pair:
    """Return a change of tangent, held to what can be undone.

    Parameters
    ----------
    back : (float, float)
        From `shared_part`.
    first, second : float
        The change of the two derivatives.
    """
    along = back[0] * first + back[1] * second
    held = min(1.0, _MOST / abs(along)) if along != 0.0 else 1.0
    return held * first, held * second


@compiled
def straighten(X: Array, row: int, n: int, back: Pair, turn: Pair) -> None:
    """Let the crosstalk's errors take up what the common part of u does along another tangent.

    Parameters
    ----------
    X : ndarray, shape (rows, n, n + p)
        Roots of covariances; the row is changed in place.
    row, n : int
        The hypothesis, and its number of states.
    back : (float, float)
        From `shared_part`.
    turn : (float, float)
        Derivatives of the readings along u at the anchor, less those that will be taken.
    """
    for j in range(n):
        common = back[0] * X[row, 2, j] + back[1] * X[row, 3, j]
        X[row, 2, j] += turn[0] * common
        X[row, 3, j] += turn[1] * common


@compiled
def follow(
    x: Array,
    X: Array,
    row: int,
    before: tuple[float, float, float],
    back: Pair,
    turn: Pair,
    gain: float,
    curve: Curve,
) -> None:
    """Undo `straighten` after an update, and bring the anchor to where the object is now.

    Parameters
    ----------
    x, X : ndarray
        Updated in the coordinates of `straighten`; changed in place.
    row : int
        The hypothesis.
    before : (float, float, float)
        u and crosstalk before the update.
    back, turn
        As for `straighten`.
    gain : float
        The frame's factor on the sensor's gain.
    curve : Curve
        The curve.
    """
    n = X.shape[1]
    scale = 1.0 + back[0] * turn[0] + back[1] * turn[1]
    change1, change2 = x[row, 2] - before[1], x[row, 3] - before[2]
    common = (back[0] * change1 + back[1] * change2) / scale
    # the curve bends away from its tangent: what the readings are expected to be stays
    here1, here2, _, _ = mean_at(x[row, 0] - common, curve)
    there1, there2, _, _ = mean_at(x[row, 0], curve)
    _, _, s1, s2 = mean_at(x[row, ANCHOR], curve)
    x[row, 2] += gain * (here1 + s1 * common - there1) - turn[0] * common
    x[row, 3] += gain * (here2 + s2 * common - there2) - turn[1] * common
    # what an update corrects is no motion: the readings' errors stay what they are
    _, _, e1, e2 = mean_at(x[row, 0], curve)
    bend1, bend2 = gain * (s1 - e1) - turn[0], gain * (s2 - e2) - turn[1]
    x[row, ANCHOR] = x[row, 0]
    for j in range(n):
        follows = (back[0] * X[row, 2, j] + back[1] * X[row, 3, j]) / scale
        X[row, 2, j] += bend1 * follows
        X[row, 3, j] += bend2 * follows
