"""What draws say about their own convergence: R-hat, effective sample size, autocorrelation.

Walkers of one ensemble propose from one another, so an ensemble counts as one chain. The effective
sample size comes from the series of means over an ensemble's walkers, which carries whatever
correlation the walkers have among themselves. Walkers that began at draws of the posterior are
draws of it, independent of one another, after any number of steps. So however short they walk and
however long they stay, their means over the steps differ by as much as these are uncertain.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = [
    "autocorrelation_time",
    "effective_sample_size",
    "rank_normalise",
    "split_r_hat",
    "tail_effective_sample_size",
]

Array = NDArray[np.float64]

_WINDOW = 5.0  # Sokal's: sum the autocorrelation up to the first lag above five times its sum


def _autocovariance(series: Array, common: bool) -> Array:
    """Autocovariance along the first axis of (steps, m), about each column's mean or all's."""
    steps = series.shape[0]
    centred = series - (series.mean() if common else series.mean(axis=0))
    spectrum = scipy.fft.rfft(centred, n=2 * scipy.fft.next_fast_len(steps), axis=0)
    power = scipy.fft.irfft((spectrum * spectrum.conj()).real, axis=0)[:steps]
    return np.asarray(power / steps)


def autocorrelation_time(series: Array, common: bool = False) -> float:
    """Return the integrated autocorrelation time of parallel series.

    Parameters
    ----------
    series : ndarray, shape (steps, m)
        m series of the same law; their autocovariances are averaged.
    common : bool
        Take deviations from the mean of all series instead of each series' own. Own means hide a
        share of ten times the time over the length, a fifth at fifty times, of the time itself; a
        common one hides m times less, and series that disagree make the time long.

    Returns
    -------
    float
        At least 1 [steps]; nan where a series does not move, which is a finding.
    """
    covariance = _autocovariance(series, common)
    if not np.all(covariance[0] > 0):
        return math.nan
    mean = covariance.mean(axis=1)
    taus = 2.0 * np.cumsum(mean / mean[0]) - 1.0
    inside = np.arange(taus.size) < _WINDOW * taus
    window = int(np.argmin(inside)) if not inside.all() else taus.size - 1
    return float(max(taus[window], 1.0))


def effective_sample_size(draws: Array, start: float | None = None) -> float:
    """Return the effective sample size of the mean of all draws.

    Parameters
    ----------
    draws : ndarray, shape (ensembles, walkers, steps)
        Draws of one quantity.
    start : float or None
        Effective size of the draws of the posterior at which the walkers began; None where they
        began elsewhere, and walked long.

    Returns
    -------
    float
        nan where the quantity is constant: there is nothing to estimate.
    """
    ensembles, _, steps = draws.shape
    variance = float(draws.var())
    if start is not None:
        return _of_short_walks(draws, variance, start)
    means = draws.mean(axis=1)
    # between the ensembles as well as within: both say how uncertain the mean is
    tau = autocorrelation_time(means.T, common=True)
    square = float(means.var(ddof=1)) * tau / (ensembles * steps)
    if not variance > 0 or not square > 0:
        return math.nan
    return float(min(variance / square, draws.size))


def _of_short_walks(draws: Array, variance: float, start: float) -> float:
    """Return the same from the spread of the walkers' means, and what is left of the start's error.

    The regression of a walker's mean on where it began says how much of an error of the start all
    means still have in common.
    """
    means, first = draws.mean(axis=2).ravel(), draws[:, :, 0].ravel()
    spread = float(first.var())
    common = float(np.mean((first - first.mean()) * (means - means.mean())))
    left = common / spread if spread > 0 else 0.0
    square = float(means.var(ddof=1)) / means.size + left**2 * variance / start
    if not variance > 0 or not square > 0:
        return math.nan
    return float(min(variance / square, draws.size))


def rank_normalise(draws: Array) -> Array:
    """Replace draws by normal scores of their ranks (Vehtari et al. 2021), same shape."""
    ranks = scipy.stats.rankdata(draws, axis=None).reshape(draws.shape)
    return np.asarray(scipy.special.ndtri((ranks - 0.375) / (draws.size + 0.25)))


def tail_effective_sample_size(draws: Array, start: float | None = None) -> float:
    """Return the smaller effective sample size of the 5 % and 95 % quantiles' indicators."""
    quantiles = np.quantile(draws, [0.05, 0.95])
    return float(min(effective_sample_size((draws <= q).astype(float), start) for q in quantiles))


def split_r_hat(draws: Array) -> float:
    """Return the rank-normalised R-hat over ensembles, each split in halves of its steps.

    Parameters
    ----------
    draws : ndarray, shape (ensembles, walkers, steps)
        Draws of one quantity.

    Returns
    -------
    float
        The larger of the R-hat of location and of spread (folded); 1 for a constant.
    """
    half = draws.shape[2] // 2
    if half < 2:
        return math.inf
    folded = np.abs(draws - np.median(draws))
    return max(_r_hat(rank_normalise(part), half) for part in (draws, folded))


def _r_hat(scores: Array, half: int) -> float:
    chains = np.concatenate([scores[:, :, :half], scores[:, :, -half:]])
    chains = chains.reshape(chains.shape[0], -1)
    within = float(chains.var(axis=1, ddof=1).mean())
    between = float(chains.mean(axis=1).var(ddof=1))
    if not within > 0:
        return 1.0 if between == 0 else math.inf
    n = chains.shape[1]
    return math.sqrt((n - 1) / n + between / within)
