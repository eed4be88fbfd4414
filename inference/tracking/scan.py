"""Choosing the places of a scan: between two of them a frame's density has at most one maximum."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.table import KNOT_SPACING, TURN

__all__ = ["places_around_folds", "scan_of"]

Array = NDArray[np.float64]

_VISIBLE = 0.1  # standard deviations of a reading below which a turn is not seen


def scan_of(positions: Array, values: Array, by_rate: bool, rate_sd: float) -> NDArray[np.int64]:
    """Choose knots between which a frame's density has at most one maximum, but for folds.

    They are at most `KNOT_SPACING` apart, and closer where the curve turns visibly; by rate a turn
    back of its direction counts.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Evenly spaced knots u = log r, ascending.
    values : ndarray, shape (n, 2)
        Mean readings, or the factors of the rate, in units of the noise.
    by_rate : bool
        Whether derivatives in time are read.
    rate_sd : float
        Standard deviation of the rate that they are multiplied by [1/s].

    Returns
    -------
    ndarray of int, shape (s,)
        Indices of the knots, ascending, both ends among them.
    """
    last = positions.size - 1
    step = float((positions[-1] - positions[0]) / last)
    stride = max(1, int(KNOT_SPACING / step))
    chosen = np.unique(np.append(np.arange(0, last, stride), last))
    while True:
        seen = values[chosen]
        if by_rate:
            size = np.linalg.norm(seen, axis=1) * 3.0 * rate_sd
            angle = np.unwrap(np.arctan2(seen[:, 1], seen[:, 0]), period=math.pi)
            # along the direction nothing is seen, since the rate is free
            seen = np.column_stack([np.zeros(size.size), angle])
            steps = np.diff(seen, axis=0) * np.minimum(size[1:], size[:-1])[:, None]
        else:
            steps = np.diff(seen, axis=0)
        length = np.linalg.norm(steps, axis=1)
        along = np.einsum("ij,ij->i", steps[1:], steps[:-1])
        turns = along < TURN * length[1:] * length[:-1]
        turns &= np.maximum(length[1:], length[:-1]) > _VISIBLE
        split = np.zeros(length.size, dtype=bool)
        split[:-1] |= turns & (length[:-1] > _VISIBLE)
        split[1:] |= turns & (length[1:] > _VISIBLE)
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen.astype(np.int64)
        middle = (chosen[:-1] + chosen[1:])[split] // 2
        chosen = np.unique(np.concatenate([chosen, middle]))


def places_around_folds(positions: Array, values: Array, slopes: Array) -> Array:
    """Return the folds of a curve, and a place on either side of each.

    Where the curve turns back between two knots, one reading has two ranges there, however close
    the knots are. With the fold and both sides among the places its two modes are told apart as
    soon as the readings differ visibly.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Knots u = log r, ascending.
    values, slopes : ndarray, shape (n, 2)
        Mean readings in units of the noise, and their derivatives along u.

    Returns
    -------
    ndarray, shape (3 f,)
        Within the knots, in no order.
    """
    places: list[float] = []
    back = np.einsum("ij,ij->i", slopes[1:], slopes[:-1]) < 0.0
    for k in np.flatnonzero(back):
        turn = slopes[k + 1] - slopes[k]
        size = float(np.linalg.norm(turn))
        ends = slice(k, k + 2)
        along = turn / size
        at, rising = values[ends] @ along, slopes[ends] @ along
        curve = scipy.interpolate.CubicHermiteSpline(positions[ends], at, rising)
        curvature = size / float(positions[k + 1] - positions[k])
        side = math.sqrt(2.0 * _VISIBLE / curvature)
        for fold in curve.derivative().roots(extrapolate=False):
            places += [fold - side, fold, fold + side]
    return np.clip(np.asarray(places, dtype=np.float64), positions[0], positions[-1])
