"""Cross-validated predictive density: each frame predicted from all others, without refitting.

Pareto-smoothed importance sampling (Vehtari, Gelman, Gabry 2017; Vehtari et al. 2024): draws given
all frames, weighted by one over the likelihood of a frame, are draws given the others.
"""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.sampling.importance import generalised_pareto

__all__ = ["MAX_K_HAT", "LeaveOneOut", "leave_one_out"]

Array = NDArray[np.float64]

MAX_K_HAT = 0.7
_LEAST_TAIL = 5
_EQUAL = 1e-9  # of the largest weight, by which equal ones differ through rounding
_TINY = 1e-290  # of the largest weight: one over it is still a number


@dataclasses.dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """Log predictive density of every frame given all others.

    Attributes
    ----------
    log_predictive : ndarray, shape (frames,)
        log p(y_j | the other frames).
    k_hat : ndarray, shape (frames,)
        Pareto shape of each frame's weights: above 0.7 the frame is too influential for its
        density to be known from these draws.
    """

    log_predictive: Array
    k_hat: Array

    @property
    def worst_k_hat(self) -> float:
        """Largest k-hat."""
        return float(self.k_hat.max())


def standard_error(frames: Array) -> float:
    """Return the standard error of a sum over frames; nan for a single frame."""
    n = frames.size
    return math.sqrt(n) * float(frames.std(ddof=1)) if n > 1 else math.nan


def _smooth(log_weights: Array) -> tuple[Array, float]:
    """Replace the largest weights by quantiles of the Pareto law fitted to them; its shape."""
    n = log_weights.size
    tail = math.ceil(min(0.2 * n, 3 * math.sqrt(n)))
    order = np.argsort(log_weights)
    largest = order[-tail:]
    top = log_weights[order[-1]]
    cut = math.exp(max(log_weights[order[-tail - 1]] - top, -700.0))
    excess = np.exp(log_weights[largest] - top) - cut
    if np.unique(excess[excess > 0]).size < _LEAST_TAIL:
        # all weights equal: nothing to smooth, nothing that dominates; or a few dwarf all others
        return log_weights, -math.inf if excess.max() <= _EQUAL else math.inf
    shape, scale = generalised_pareto(np.maximum(excess, _TINY))
    probability = (np.arange(tail) + 0.5) / tail
    # ((1 - p)^-k - 1) / -k, good at k = 0 as well
    step = scipy.special.boxcox1p(-probability, -shape)
    smoothed = log_weights.copy()
    # never above the largest raw weight: the fit may reach beyond it
    smoothed[largest] = np.minimum(np.log(cut - scale * step) + top, top)
    return smoothed, shape


def leave_one_out(log_likelihoods: Array, log_weights: Array | None = None) -> LeaveOneOut:
    """Predict every frame from all others.

    Parameters
    ----------
    log_likelihoods : ndarray, shape (draws, frames)
        log p(y_j | draw i), frames independent given a draw.
    log_weights : ndarray, shape (draws,), optional
        Of weighted draws; left out: draws from the posterior itself.

    Returns
    -------
    LeaveOneOut
        With k-hat infinite where some draw gives a frame no density at all.
    """
    draws, frames = log_likelihoods.shape
    base = np.zeros(draws) if log_weights is None else log_weights
    keep = np.isfinite(base)
    base, log_likelihoods = base[keep], log_likelihoods[keep]
    log_predictive, k_hat = np.full(frames, -np.inf), np.full(frames, np.inf)
    for j in range(frames):
        likelihood = log_likelihoods[:, j]
        if not np.isfinite(likelihood).all() or likelihood.size <= 2 * _LEAST_TAIL:
            continue
        weights, k_hat[j] = _smooth(base - likelihood)
        log_predictive[j] = scipy.special.logsumexp(weights + likelihood)
        log_predictive[j] -= scipy.special.logsumexp(weights)
    return LeaveOneOut(log_predictive, k_hat)
