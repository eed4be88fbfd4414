"""Importance sampling with the Pareto diagnostic that tells when it cannot be trusted."""

import dataclasses
import math
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity

__all__ = [
    "MAX_K_HAT",
    "MAX_SMOOTHED_K_HAT",
    "Law",
    "WeightedDraws",
    "draw_weighted",
    "generalised_pareto",
    "log_ratio",
    "pareto_k_hat",
    "smoothed",
    "weighted_by",
    "weighted_sizes",
]

Array = NDArray[np.float64]

MAX_K_HAT = 0.5  # of weights as they are: beyond it they have no variance
MAX_SMOOTHED_K_HAT = 0.7  # of those whose tail is smoothed (Vehtari et al. 2024)
_TAILS = (0.05, 0.95)  # of mass, where the quantiles of an interval are
_OF_A_MEAN = 0.5  # of a target, that the effective size of every mean has to reach
_LEAST_EXCESS = 5  # weights above the cut that a shape is fitted to
_NOTHING = 1e-300  # of the largest weight: what is less counts for none
_EQUAL = 1e-9  # of the largest weight, by which equal ones differ through rounding


class Law(Protocol):
    """What draws come from: a mixture, a proposal, a blend of proposals."""

    def draw(self, rng: np.random.Generator | np.random.RandomState, n: int, /) -> Array:
        """Draw n points, shape (n, d)."""
        ...

    def log_density(self, z: Array, /) -> Array:
        """Return the log density at z of shape (n, d), shape (n,)."""
        ...


@dataclasses.dataclass(frozen=True, eq=False)
class WeightedDraws:
    """Draws from a proposal with their normalised weights.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Draws.
    log_density : ndarray, shape (n,)
        Target log density.
    weights : ndarray, shape (n,)
        Sum to one.
    k_hat : float
        Pareto shape of the largest weights; means are to be trusted below 0.5.
    log_evidence : float
        Log of the integral of the target.
    """

    z: Array
    log_density: Array
    weights: Array
    k_hat: float
    log_evidence: float

    @property
    def ess(self) -> float:
        """Importance sample size: of a quantity that knows nothing of the weights."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def worth(self) -> float:
        """What a target is held to: the importance sample size, and half of it by every mean.

        Weights are heaviest where a proposal holds too little, mostly in a tail: means of unknowns
        that reach there rest on fewer draws. Of weights with a long tail the last of these come
        slowly, and what is stated of an unknown is its own size.
        """
        sizes = [weighted_sizes(column, self.weights)[0] for column in self.z.T]
        return min(self.ess, min(sizes, default=math.inf) / _OF_A_MEAN)

    @property
    def that_count(self) -> "WeightedDraws":
        """Those of any weight: the rest lie far out, where squares of parameters overflow."""
        some = self.weights > 0
        z, log_density = self.z[some], self.log_density[some]
        return dataclasses.replace(self, z=z, log_density=log_density, weights=self.weights[some])


def weighted_sizes(x: Array, weights: Array) -> tuple[float, float]:
    """Return effective sample sizes of weighted draws of one quantity.

    Parameters
    ----------
    x, weights : ndarray, shape (n,)
        Draws, and their weights, which sum to one.

    Returns
    -------
    (float, float)
        Of the mean, and the lesser one of the shares below the quantiles of 5 and 95 %: the
        variance of a quantity over that of its self-normalised estimate (Owen 2013, 9.2). The
        importance sample size where the draws do not differ.
    """
    # draws of no weight lie far out, where squares overflow
    some = weights > 0
    order = np.argsort(x[some])
    x, w = x[some][order], weights[some][order]
    square, below = w**2, np.cumsum(w)
    alone = 1.0 / float(square.sum())
    centred = x - w @ x
    centred /= np.abs(centred).max() or 1.0
    error = float(square @ centred**2)
    bulk = float(w @ centred**2) / error if error > 0 else alone
    tails = []
    for cut in np.minimum(np.searchsorted(below, _TAILS), x.size - 1):
        share = min(float(below[cut]), 1.0)
        inside = np.arange(x.size) <= cut
        error = float(square @ (inside - share) ** 2)
        tails.append(share * (1.0 - share) / error if error > 0 else alone)
    return bulk, min(tails)


def generalised_pareto(excess: Array) -> tuple[float, float]:
    """Estimate shape and scale of excesses over a threshold (Zhang and Stephens 2009).

    Parameters
    ----------
    excess : ndarray, shape (n,)
        Positive, at least five.

    Returns
    -------
    (float, float)
        The shape, drawn a little towards 0.5 (Vehtari et al. 2024), and the scale.
    """
    x = np.sort(excess)
    n = x.size
    m = 30 + int(math.sqrt(n))
    quartile = x[int(n / 4 + 0.5) - 1]
    j = np.arange(1, m + 1)
    b = 1 / x[-1] + (1 - np.sqrt(m / (j - 0.5))) / (3 * quartile)
    shape = np.log1p(-b[:, None] * x).mean(axis=1)
    profile = n * (np.log(-b / shape) - shape - 1)
    weights = scipy.special.softmax(profile)
    best = float(np.sum(b * weights))
    k = float(np.log1p(-best * x).mean())
    # weak prior of shape 0.5, worth ten observations (Vehtari et al. 2024)
    return (n * k + 10 * 0.5) / (n + 10), -k / best


def _tail(n: int) -> int:
    """Return how many of n weights are the tail that a Pareto law is fitted to."""
    return int(min(0.2 * n, 3 * math.sqrt(n)))


def pareto_k_hat(log_weights: Array) -> float:
    """Return the Pareto shape k-hat of importance weights.

    Parameters
    ----------
    log_weights : ndarray, shape (n,)
        -inf counts as weight zero.

    Returns
    -------
    float
        inf where too few weights are positive to tell, or a few are all there is; minus inf where
        all are equal.
    """
    finite = log_weights[np.isfinite(log_weights)]
    tail = _tail(log_weights.size)
    if finite.size < tail + 1 or tail < 5:
        return math.inf
    ordered = np.sort(finite)
    weights = np.exp(ordered[-tail - 1 :] - ordered[-1])
    excess = weights[1:] - weights[0]
    positive = excess[excess > _NOTHING]
    if positive.size >= _LEAST_EXCESS:
        return generalised_pareto(positive)[0]
    # equal weights, or a few that dwarf all others
    return -math.inf if excess[-1] <= _EQUAL else math.inf


def smoothed(log_weights: Array) -> tuple[Array, float]:
    """Return weights whose largest follow the Pareto law fitted to them (Vehtari et al. 2024).

    Parameters
    ----------
    log_weights : ndarray, shape (n,)
        -inf counts as weight zero.

    Returns
    -------
    ndarray, shape (n,)
        Log weights in the same order; none above the largest.
    float
        Pareto k-hat of those given.
    """
    k_hat = pareto_k_hat(log_weights)
    if not math.isfinite(k_hat):
        return log_weights, k_hat
    tail = _tail(log_weights.size)
    order = np.argsort(log_weights)
    top = log_weights[order[-1]]
    log_cut = float(log_weights[order[-tail - 1]] - top)
    largest = np.exp(log_weights[order[-tail:]] - top)
    shape, scale = generalised_pareto(np.maximum(largest - math.exp(log_cut), _NOTHING))
    log_excess = _log_pareto_quantiles(shape, scale, (np.arange(tail) + 0.5) / tail)
    result = log_weights.copy()
    result[order[-tail:]] = top + np.minimum(np.logaddexp(log_cut, log_excess), 0.0)
    return result, k_hat


def _log_pareto_quantiles(shape: float, scale: float, p: Array) -> Array:
    """Return logs of quantiles: a shape of 100 has some beyond the largest number."""
    x = -np.log1p(-p)
    if shape == 0.0:
        return np.asarray(math.log(scale) + np.log(x))
    if shape < 0.0:
        return np.asarray(np.log(-np.expm1(shape * x)) + math.log(scale) - math.log(-shape))
    x = shape * x
    return np.asarray(x + np.log(-np.expm1(-x)) + math.log(scale) - math.log(shape))


def log_ratio(log_density: Array, log_law: Array) -> Array:
    """Return the log of a target over a law.

    Parameters
    ----------
    log_density, log_law : ndarray, shape (n,)
        Log densities of the target and of the law, at the same points.

    Returns
    -------
    ndarray, shape (n,)
        -inf where the target is zero, also so far out that the law is no number there.
    """
    ratio = np.full(log_density.shape, -np.inf)
    return np.asarray(np.subtract(log_density, log_law, out=ratio, where=log_density > -np.inf))


def draw_weighted(
    density: CollapsedDensity, proposal: Law, rng: np.random.Generator, n: int
) -> WeightedDraws:
    """Draw from a proposal and weight by the collapsed density.

    Parameters
    ----------
    n : int
        Number of draws.

    Returns
    -------
    WeightedDraws
        With k_hat inf where no draw has a positive density.
    """
    z = proposal.draw(rng, n)
    return weighted_by(z, density(z), proposal.log_density(z))


def weighted_by(
    z: Array, log_density: Array, log_proposal: Array, *, smooth: bool = False
) -> WeightedDraws:
    """Weight draws.

    Parameters
    ----------
    z : ndarray, shape (n, d)
        Draws from a proposal.
    log_density, log_proposal : ndarray, shape (n,)
        Log densities of the target and of the proposal there.
    smooth : bool
        Whether the largest weights follow the Pareto law fitted to them.

    Returns
    -------
    WeightedDraws
        With k_hat inf where no draw has a positive density.
    """
    n, log_weights = len(z), log_ratio(log_density, log_proposal)
    if smooth:
        log_weights, k_hat = smoothed(log_weights)
    else:
        k_hat = pareto_k_hat(log_weights)
    total = float(scipy.special.logsumexp(log_weights))
    if not math.isfinite(total):
        return WeightedDraws(z, log_density, np.full(n, 1 / n), math.inf, -math.inf)
    weights = np.exp(log_weights - total)
    weights /= weights.sum()  # logs of 1e12 have rounding errors of 1e-4
    return WeightedDraws(z, log_density, weights, k_hat, total - math.log(n))
