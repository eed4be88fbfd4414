"""How good ranges are: error, coverage of 90 % intervals, CRPS, shares without a single range."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from service.report.uncertain import (
    blocks_of,
    error_of_mean,
    error_of_quantile,
    share_band,
)

__all__ = ["Scores", "crps_of_draws", "crps_of_normals", "scores_of", "scores_of_roots"]

Array = NDArray[np.float64]

Z90 = 1.6448536269514722  # of a 90 % interval


class Scores(NamedTuple):
    """Figures of frames whose truth is known; None where there is nothing to count.

    Attributes
    ----------
    median_error, p95_error : float or None
        Quantiles of the relative error of the frames with a single range.
    coverage : float or None
        Share of the frames with intervals in which one of the 90 % intervals holds the truth.
    crps : float or None
        Mean continuous ranked probability score of the frames with intervals, over the truth: for
        a number without interval it would be its relative error.
    single, ambiguous, refused : float
        Shares of frames with one range, with several, and with none.
    sets : int
        Data sets, or of one sweep blocks of neighbouring frames.
    median_se, p95_se, crps_se, ambiguous_se, refused_se : float or None
        Monte Carlo errors (one standard error) of the figures of these names.
    coverage_low, coverage_high : float or None
        Ends of the 95 % band of the coverage.
    """

    median_error: float | None
    p95_error: float | None
    coverage: float | None
    crps: float | None
    single: float
    ambiguous: float
    refused: float
    sets: int = 1
    median_se: float | None = None
    p95_se: float | None = None
    crps_se: float | None = None
    ambiguous_se: float | None = None
    refused_se: float | None = None
    coverage_low: float | None = None
    coverage_high: float | None = None


def crps_of_normals(truth: Array, mean: Array, sd: Array, weight: Array) -> Array:
    """Return the CRPS of mixtures of normal laws (Grimit et al. 2006, equation 3).

    Parameters
    ----------
    truth : ndarray, shape (n,)
        What came true.
    mean, sd, weight : ndarray, shape (n, k)
        Of the parts; nan where there is none.

    Returns
    -------
    ndarray, shape (n,)
        nan where a mixture has no part.
    """
    there = np.isfinite(mean) & np.isfinite(sd) & np.isfinite(weight)
    m, s, w = (np.where(there, part, 0.0) for part in (mean, sd, weight))
    total = w.sum(axis=1)
    w = w / np.where(total > 0, total, 1.0)[:, None]

    def distance(gap: Array, spread: Array) -> Array:
        ratio = gap / np.where(spread > 0, spread, 1.0)
        density = np.exp(-0.5 * ratio**2) / np.sqrt(2 * np.pi)
        found = 2 * spread * density + gap * (2 * special.ndtr(ratio) - 1)
        return np.where(spread > 0, found, np.abs(gap))

    near = (w * distance(truth[:, None] - m, s)).sum(axis=1)
    spread = np.hypot(s[:, :, None], s[:, None, :])
    pairs = distance(m[:, :, None] - m[:, None, :], spread)
    own = np.einsum("ni,nj,nij->n", w, w, pairs)
    return np.where(total > 0, near - 0.5 * own, np.nan)


def crps_of_draws(truth: Array, draws: Array) -> Array:
    """Return the CRPS of draws.

    Parameters
    ----------
    truth : ndarray, shape (n,)
        What came true.
    draws : ndarray, shape (k, n)
        Draws of equal weight.

    Returns
    -------
    ndarray, shape (n,)
    """
    k = len(draws)
    ordered = np.sort(draws, axis=0)
    rank = (2 * np.arange(1, k + 1) - k - 1)[:, None]
    return np.asarray(np.abs(draws - truth).mean(axis=0) - (rank * ordered).sum(axis=0) / k**2)


def scores_of(
    truth: Array,
    range_m: Array,
    ambiguous: NDArray[np.bool_],
    held: Array,
    crps: Array,
    sets: NDArray[np.int_] | None = None,
) -> Scores:
    """Sum up frames.

    Parameters
    ----------
    truth, range_m : ndarray, shape (n,)
        True ranges, and single ranges that were found, nan where there is none [m].
    ambiguous : ndarray of bool, shape (n,)
        Where several ranges were found.
    held : ndarray, shape (n,)
        1 where an interval holds the truth, 0 where none does, nan where there is no interval.
    crps : ndarray, shape (n,)
        The score [m], nan where there is none.
    sets : ndarray of int, shape (n,), optional
        The data set of each frame; left out: blocks of neighbours.

    Returns
    -------
    Scores
    """
    error = np.abs(range_m - truth) / truth
    single = np.isfinite(error)
    median, tail = (
        np.quantile(error[single], [0.5, 0.95]).tolist() if single.any() else (None, None)
    )
    relative = crps / truth
    along = sets is None
    of = blocks_of(truth.size) if sets is None else sets
    band = share_band(held, of, along)

    def mean(values: Array) -> float | None:
        there = values[np.isfinite(values)]
        return float(there.mean()) if there.size else None

    doubled = ambiguous & ~single
    several, alone = float(np.mean(doubled)), float(np.mean(single))
    return Scores(
        median,
        tail,
        mean(held),
        mean(relative),
        alone,
        several,
        max(1.0 - alone - several, 0.0),
        sets=np.unique(of).size,
        median_se=error_of_quantile(error, 0.5, of, along),
        p95_se=error_of_quantile(error, 0.95, of, along),
        crps_se=error_of_mean(relative, of, along),
        ambiguous_se=error_of_mean(doubled.astype(float), of, along),
        refused_se=error_of_mean((~single & ~ambiguous).astype(float), of, along),
        coverage_low=None if band is None else band[0],
        coverage_high=None if band is None else band[1],
    )


def scores_of_roots(
    truth: Array,
    range_m: Array,
    several: NDArray[np.bool_],
    roots: Array,
    sd: Array,
    weight: Array,
    sets: NDArray[np.int_] | None = None,
) -> Scores:
    """Sum up frames whose ranges stand side by side, each with its standard deviation.

    Parameters
    ----------
    truth, range_m : ndarray, shape (n,)
        As for `scores_of`.
    several : ndarray of bool, shape (n,)
        Where there are several.
    roots, sd, weight : ndarray, shape (n, k)
        The ranges and their standard deviations [m], and weights; nan where there is none.
    sets : ndarray of int, shape (n,), optional
        As for `scores_of`.

    Returns
    -------
    Scores
    """
    there = np.isfinite(sd) & np.isfinite(roots)
    near = there & (np.abs(roots - truth[:, None]) <= Z90 * np.where(there, sd, 0.0))
    held = np.where(there.any(axis=1), near.any(axis=1), np.nan)
    return scores_of(
        truth, range_m, np.asarray(several), held, crps_of_normals(truth, roots, sd, weight), sets
    )
