"""Bridge sampling: evidence where importance weights cannot be trusted.

Draws of the posterior stand for what a proposal reaches too seldom, and draws of the proposal for
its constant (Meng and Wong 1996).
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.sampling.proposal import Mixture, Proposal

__all__ = ["bridge"]

Array = NDArray[np.float64]

_BATCHES = 8


def _estimate(walked: Array, drawn: Array, share: float) -> float:
    """Iterate the optimal bridge from log ratios of target to proposal; share of the former."""
    top = float(np.median(walked))
    a, b = walked - top, drawn - top
    first, second = math.log(share), math.log1p(-share)
    value = 0.0
    for _ in range(1000):
        above = scipy.special.logsumexp(b - np.logaddexp(first + b, second + value))
        below = scipy.special.logsumexp(-np.logaddexp(first + a, second + value))
        before, value = value, float((above - math.log(b.size)) - (below - math.log(a.size)))
        if not abs(value - before) > 1e-9:
            break
    return value + top


def bridge(
    z: Array, log_density: Array, proposal: Mixture | Proposal, drawn: Array, drawn_density: Array
) -> tuple[float, float]:
    """Estimate the log of the integral of the target.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws of the target, of which some may be equal.
    log_density : ndarray, shape (n,)
        Target log density of them.
    proposal : Mixture or Proposal
        Not fitted to these draws.
    drawn : ndarray, shape (m, d)
        Draws of the proposal.
    drawn_density : ndarray, shape (m,)
        Target log density of them.

    Returns
    -------
    (float, float)
        Log integral, and its standard error from batches.
    """
    ratio = log_density - proposal.log_density(z)
    other = drawn_density - proposal.log_density(drawn)
    share = len(z) / (len(z) + len(drawn))
    value = _estimate(ratio, other, share)
    parts = [_estimate(ratio[k::_BATCHES], other[k::_BATCHES], share) for k in range(_BATCHES)]
    return value, float(np.std(parts, ddof=1)) / math.sqrt(_BATCHES)
