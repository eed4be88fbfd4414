"""Are ranks even? A chi-square test, and simultaneous bands of their distribution function."""

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from benchmarks.calibration.ranks import DRAWS

__all__ = ["BINS", "chi_square_p", "ecdf_difference", "simultaneous_band"]

Array = NDArray[np.float64]

BINS = 10  # chosen before any rank was seen; five are expected in each with fifty data sets
_VALUES = DRAWS + 1
_SIMULATIONS = 20_000


def chi_square_p(ranks: ArrayLike) -> float:
    """Return the p-value of ranks in 0..`DRAWS` against the uniform law, in `BINS` bins.

    Its lower tail is right to a third down to 3e-4 with fifty ranks (multinomial draws).
    """
    counts = np.bincount(np.asarray(ranks, dtype=int) * BINS // _VALUES, minlength=BINS)
    return float(stats.chisquare(counts).pvalue)


def ecdf_difference(ranks: ArrayLike) -> Array:
    """Return the share of ranks below 1..`DRAWS` minus what is expected, shape (`DRAWS`,)."""
    counts = np.bincount(np.asarray(ranks, dtype=int), minlength=_VALUES)
    edges = np.arange(1, _VALUES)
    return np.asarray(np.cumsum(counts)[:-1] / counts.sum() - edges / _VALUES)


@functools.cache
def simultaneous_band(sets: int, alarm: float) -> tuple[Array, Array]:
    """Return bounds of `ecdf_difference` that even ranks leave anywhere with probability `alarm`.

    Saeilynoja et al. (2022), Statistics and Computing 32, 32, by simulation: the pointwise level is
    the quantile of the least pointwise p-value.

    Parameters
    ----------
    sets : int
        Number of ranks.
    alarm : float
        False-alarm rate over the whole curve.

    Returns
    -------
    low, high : ndarray, shape (`DRAWS`,)
    """
    edges = np.arange(1, _VALUES) / _VALUES
    counts = np.arange(sets + 1)[:, None]
    tails = np.minimum(
        stats.binom.cdf(counts, sets, edges), stats.binom.sf(counts - 1, sets, edges)
    )
    rng = np.random.default_rng(sets)
    columns = np.arange(DRAWS)
    least = np.empty(_SIMULATIONS)
    for k in range(_SIMULATIONS):
        drawn = np.bincount(rng.integers(_VALUES, size=sets), minlength=_VALUES)
        least[k] = tails[np.cumsum(drawn)[:-1], columns].min()
    level = float(np.quantile(least, alarm))
    low = stats.binom.ppf(level, sets, edges) / sets - edges
    high = stats.binom.isf(level, sets, edges) / sets - edges
    return low, high
