"""Shares of a posterior, such as the weight of a mode, and their Monte Carlo errors."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.sampling.diagnostics import effective_sample_size

__all__ = ["resampled_share_error", "share_error", "weighted_share_error"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def share_error(inside: Mask, start: float | None = None) -> float | None:
    """Return the standard error of a share of the draws of several ensembles.

    The largest of three estimates: that of a Markov chain of two states with as many entries as
    were seen, that from the spread of the walkers' own shares, and that from the spread of the
    ensembles'. The first is the sharpest, the others see what it assumes away: memory beyond one
    step, and walkers that depend on one another.

    Parameters
    ----------
    inside : ndarray of bool, shape (ensembles, walkers, steps)
        Whether each draw counts.
    start : float or None
        Effective size of the draws of the posterior at which the walkers began; None where they
        began elsewhere.

    Returns
    -------
    float or None
        0 where all draws count. None where no walker ever came in from outside: the share is then
        that of the starting points, of unknown error.
    """
    ensembles, walkers, _ = inside.shape
    share = float(inside.mean())
    if share == 1.0:
        return 0.0
    if start is not None:
        size = effective_sample_size(inside.astype(float), start)
        return math.sqrt(share * (1.0 - share) / size) if size > 0 else None
    changes = np.diff(inside.astype(np.int8), axis=2)
    # in the long run as many come as go; over a short one either may be seen first
    entries = 0.5 * float(np.abs(changes).sum())
    if entries == 0.0:
        return None
    alone = share * (1.0 - share) / inside.size
    # two-state chain of rates a and b: variance p (1 - p) (2 / (a + b) - 1) / n,
    # where p (1 - p) (a + b) is the share of steps that are entries
    rates = entries / changes.size / (share * (1.0 - share))
    variances = [alone * max(2.0 / rates - 1.0, 1.0)]
    if ensembles * walkers > 1:
        of_walkers = inside.mean(axis=2)
        variances.append(float(of_walkers.var(ddof=1)) / of_walkers.size)
    if ensembles > 1:
        of_ensembles = inside.mean(axis=(1, 2))
        variances.append(float(of_ensembles.var(ddof=1)) / ensembles)
    return math.sqrt(max(variances))


def weighted_share_error(inside: Mask, weights: Array) -> float:
    """Return the standard error of a share of weighted draws.

    Parameters
    ----------
    inside : ndarray of bool, shape (n,)
        Whether each draw counts.
    weights : ndarray, shape (n,)
        Sum to one.

    Returns
    -------
    float
        That of a self-normalised estimate.
    """
    share = float(weights[inside].sum())
    return float(np.sqrt(np.sum((weights * (inside - share)) ** 2)))


def resampled_share_error(inside: Mask, weights: Array) -> float:
    """Return the standard error of a share of draws that were resampled by weight.

    Parameters
    ----------
    inside : ndarray of bool
        Whether each draw counts.
    weights : ndarray, same shape
        Of the draws that these were resampled from, which sum to one before.

    Returns
    -------
    float
        From the error of the weights and that of resampling.
    """
    squares = np.square(inside - inside.mean())
    return math.sqrt(float(np.mean(squares * (weights + 1.0 / inside.size))))
