"""Monte Carlo errors of what draws are summarised to: by how much another seed would move it."""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.posterior.sampling.diagnostics import effective_sample_size

__all__ = ["mean_error", "quantile_error"]

Array = NDArray[np.float64]


def _effective(draws: Array, weights: Array | None, start: float | None) -> float:
    """Return the number of independent draws that a mean of these is as good as."""
    if weights is None:
        return effective_sample_size(draws, start)
    squares = np.square(draws - draws.mean())
    # resampled by weight: the error of the weights (a sum of squared ones, of which one is the
    # share of the draw here) and that of resampling
    error = float(np.mean(weights * squares)) + float(squares.mean()) / draws.size
    return float(squares.mean()) / error if error > 0 else math.nan


def mean_error(draws: Array, weights: Array | None, start: float | None = None) -> float:
    """Return the standard error of the mean of draws.

    Parameters
    ----------
    draws : ndarray, shape (ensembles, walkers, steps)
        Draws of one quantity.
    weights : ndarray, shape (ensembles, walkers, steps), or None
        Of the draws that these were resampled from by weight, which sum to one before; None for
        walkers.
    start : float or None
        Of walkers, as of `effective_sample_size`.

    Returns
    -------
    float
        nan where the draws do not differ.
    """
    return float(draws.std()) / math.sqrt(_effective(draws, weights, start))


def quantile_error(
    draws: Array, at: float, weights: Array | None, start: float | None = None
) -> float:
    """Return the standard error of a quantile of draws (Vehtari et al. 2021).

    The share of draws below the quantile is known like that of so many independent draws: its law
    is a beta, whose quantiles at one standard deviation to either side are looked up among the
    draws. No density at the quantile is needed.

    Parameters
    ----------
    draws : ndarray, shape (ensembles, walkers, steps)
        Draws of one quantity.
    at : float
        Probability of the quantile.
    weights, start : ndarray, float, or None
        As for `mean_error`.

    Returns
    -------
    float
        nan where the draws do not differ.
    """
    below = (draws <= np.quantile(draws, at)).astype(float)
    n = _effective(below, weights, start)
    if not math.isfinite(n):
        return math.nan
    one_sd = float(scipy.special.ndtr(1.0))
    shares = scipy.stats.beta.ppf([1.0 - one_sd, one_sd], n * at + 1.0, n * (1.0 - at) + 1.0)
    return 0.5 * float(np.ptp(np.quantile(draws, np.asarray(shares))))
