"""Choosing the places of a scan: between two of them a frame's density has at most one maximum."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.table import KNOT_SPACING, TURN

__all__ = ["places_around_folds", "scan_of"]

Array = NDArray[np.float64]

_VISIBLE = 0.1  # standard deviations of a reading below which a turn is not seen


def _whitened(changes: Array, roots: Array) -> Array:
    """Return changes of readings, shape (n, 2), in units of the noise and what is added to it.

    Parameters
    ----------
    changes : ndarray, shape (n, 2)
        In units of the noise.
    roots : ndarray, shape (n, 3)
        r11, r21, r22 of the root of what is added.
    """
    r11, r21, r22 = roots.T
    first = np.hypot(1.0, r11)
    second = np.sqrt(1.0 + r22**2 + (r21 / first) ** 2)
    one = changes[:, 0] / first
    return np.column_stack([one, (changes[:, 1] - r21 * (r11 / first) * one) / second])


def _turns(before: Array, after: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell where the step before, and where that after, belongs to a turn that is visible."""
    left, right = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    turns = np.einsum("ij,ij->i", after, before) < TURN * right * left
    turns &= np.maximum(right, left) > _VISIBLE
    return turns & (left > _VISIBLE), turns & (right > _VISIBLE)


def scan_of(
    positions: Array, values: Array, roots: Array, by_rate: bool, rate_sd: float
) -> NDArray[np.int64]:
    """Choose knots between which a frame's density has at most one maximum, but for folds.

    They are at most `KNOT_SPACING` apart, and closer where the curve turns visibly, against the
    noise alone or beside what nuisance parameters add to it; by rate a turn back of its direction
    counts.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Evenly spaced knots u = log r, ascending.
    values : ndarray, shape (n, 2)
        Mean readings, or the factors of the rate, in units of the noise.
    roots : ndarray, shape (n, 3)
        r11, r21, r22 of the root of the covariance that nuisance parameters add.
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
        split = np.zeros(len(steps), dtype=bool)
        here = roots[chosen[1:-1]]
        for added in (np.zeros_like(here), here) if here.any() else (np.zeros_like(here),):
            left, right = _turns(_whitened(steps[:-1], added), _whitened(steps[1:], added))
            split[:-1] |= left
            split[1:] |= right
        split &= np.diff(chosen) > 1
        if not split.any():
            return chosen.astype(np.int64)
        middle = (chosen[:-1] + chosen[1:])[split] // 2
        chosen = np.unique(np.concatenate([chosen, middle]))


def places_around_folds(positions: Array, values: Array, slopes: Array, roots: Array) -> Array:
    """Return the folds of a curve, and a place on either side of each.

    Where the curve turns back between two knots, one reading has two ranges there, however close
    the knots are. So it has where a direction that nuisance parameters leave turns back, however
    far the curve goes on along theirs. With the fold and both sides among the places its two modes
    are told apart as soon as the readings differ visibly.

    Parameters
    ----------
    positions : ndarray, shape (n,)
        Knots u = log r, ascending.
    values, slopes : ndarray, shape (n, 2)
        Mean readings in units of the noise, and their derivatives along u.
    roots : ndarray, shape (n, 3)
        r11, r21, r22 of the root of the covariance that nuisance parameters add.

    Returns
    -------
    ndarray, shape (3 f,)
        Within the knots, in no order.
    """
    places: list[float] = []
    alone = np.zeros_like(roots[:-1])
    # one reading turns back at the same ranges, whatever is added to its noise
    twice = roots.any() and slopes.any(axis=0).all()
    for added in (alone, roots[:-1]) if twice else (alone,):
        left, right = _whitened(slopes[:-1], added), _whitened(slopes[1:], added)
        for k in np.flatnonzero(np.einsum("ij,ij->i", right, left) < 0.0):
            turn = right[k] - left[k]
            size = float(np.linalg.norm(turn))
            along = turn / size
            at = _whitened(values[k : k + 2], added[[k, k]]) @ along
            rising = left[k] @ along, right[k] @ along
            curve = scipy.interpolate.CubicHermiteSpline(positions[k : k + 2], at, rising)
            curvature = size / float(positions[k + 1] - positions[k])
            side = math.sqrt(2.0 * _VISIBLE / curvature)
            for fold in curve.derivative().roots(extrapolate=False):
                places += [fold - side, fold, fold + side]
    return np.clip(np.asarray(places, dtype=np.float64), positions[0], positions[-1])
