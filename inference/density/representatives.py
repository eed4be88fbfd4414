"""Frames that stand for many: a few hundred, weighted so that their likelihood is that of all.

Near a posterior the log likelihood of a frame is a smooth function of the parameters, and those of
all frames lie in a space of few dimensions: hardly more than the quadratics. A few hundred frames
are drawn with a probability that follows what each tells, weighted by its inverse, and the weights
moved as little as is needed that at given points of the parameters the weighted sum is that of all
frames (calibration: Deville and Saerndal 1992). Between such points it then is so, too, to what the
space leaves out, which is looked at where an answer is given.
"""

import dataclasses

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.density.profile import linearise

__all__ = ["Representatives", "calibrated", "drawn_by_information", "standing_for"]

Array = NDArray[np.float64]

_EVEN = 0.5  # share of the frames that are drawn whatever they tell
_ROWS = 1e-9  # of the largest singular value: below, rows of the likelihood are the same
_LEAST = 0.05  # of its weight that every frame keeps
_ROUNDS = 20


@dataclasses.dataclass(frozen=True, eq=False)
class Representatives:
    """Which frames stand for all.

    Attributes
    ----------
    chosen : ndarray of int, shape (m,)
        Indices among all frames, ascending.
    weights : ndarray, shape (m,)
        How many frames each stands for, positive.
    """

    chosen: NDArray[np.intp]
    weights: Array


def standing_for(density: CollapsedDensity, by: Representatives) -> CollapsedDensity:
    """Return the density of all frames by the likelihood of those that stand for them."""
    present = None if density.present is None else density.present[by.chosen]
    frames = np.ascontiguousarray(density.frames[by.chosen])
    return dataclasses.replace(density, frames=frames, present=present, weights=by.weights)


def drawn_by_information(
    density: CollapsedDensity, z: Array, count: int, rng: np.random.Generator
) -> Representatives:
    """Draw frames, half evenly and half by what each tells of the parameters.

    Parameters
    ----------
    density : CollapsedDensity
        Of all frames.
    z : ndarray, shape (d,)
        A point near the posterior.
    count : int
        How many are drawn; some may be the same.

    Returns
    -------
    Representatives
        Weighted so that every sum over all frames is met in the mean. The draw is systematic along
        the range: every part of it is met.
    """
    n, d = len(density.frames), z.size
    log_r = density.best_ranges(z[None])[0, :, 0]
    jacobian = linearise(density, z, log_r).jacobian.reshape(-1, d)
    basis = scipy.linalg.qr(np.concatenate([jacobian, np.eye(d)]), mode="economic")[0]
    told = np.square(basis[: len(jacobian)]).sum(axis=1).reshape(n, -1).sum(axis=1)
    total = told.sum()
    share = np.full(n, 1.0 / n) if not total > 0 else _EVEN / n + (1 - _EVEN) * told / total
    order = np.argsort(log_r, kind="stable")  # frames without object come last
    ends = np.cumsum(share[order]) * count
    places = np.searchsorted(ends, np.arange(count) + rng.random())
    chosen, times = np.unique(order[np.minimum(places, n - 1)], return_counts=True)
    return Representatives(chosen, times / (count * share[chosen]))


def calibrated(by: Representatives, likelihoods: Array) -> Representatives:
    """Move weights as little as needed that sums over all frames are met.

    Parameters
    ----------
    by : Representatives
        As drawn.
    likelihoods : ndarray, shape (points, frames)
        Log likelihoods of all frames at points of the parameters, finite; of the first point as
        they are, of the others by what they differ from the first.

    Returns
    -------
    Representatives
        With weights that stay positive.
    """
    rows = np.concatenate([np.ones((1, likelihoods.shape[1])), likelihoods])
    rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
    wanted, own = rows.sum(axis=1), rows[:, by.chosen]
    weights, free = by.weights.copy(), np.ones(by.chosen.size, dtype=bool)
    for _ in range(_ROUNDS):
        size = np.sqrt(by.weights[free])
        missing = wanted - own @ weights
        step = scipy.linalg.lstsq(own[:, free] * size, missing, cond=_ROWS)[0]
        weights[free] += size * step
        low = free & (weights < _LEAST * by.weights)
        if not low.any():
            break
        weights[low], free = _LEAST * by.weights[low], free & ~low
    return Representatives(by.chosen, weights)
