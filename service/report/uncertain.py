"""How far figures of a few data sets may be off: their Monte Carlo errors.

Frames of one data set may err together, so sets count and not frames. A single long sweep is cut
into blocks of neighbours, about as many as each holds frames; along it the error itself changes, so
that only successive blocks are compared (Wolter 2007, chapter 8).
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["band_of", "blocks_of", "error_of_mean", "error_of_quantile", "share_band"]

Array = NDArray[np.float64]
Labels = NDArray[np.int_]

_LEVEL = 0.95
# fewer cannot tell by how much they differ
_LEAST_SETS = 5


def blocks_of(frames: int) -> Labels:
    """Return the block of each frame of one sweep, shape (frames,)."""
    count = max(math.isqrt(frames), 1)
    return np.arange(frames) * count // max(frames, 1)


def error_of_mean(values: Array, sets: Labels, along: bool = False) -> float | None:
    """Return the standard error of a mean over frames, of which those of a set go together.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of the frames; nan where there is none.
    sets : ndarray of int, shape (n,)
        The set of each frame.
    along : bool
        Whether the sets are blocks along one sweep.

    Returns
    -------
    float or None
        By linearisation; None of fewer than five sets, which cannot tell.
    """
    there = np.isfinite(values)
    if not there.any():
        return None
    _, of = np.unique(sets[there], return_inverse=True)
    sums = np.bincount(of, values[there] - values[there].mean())
    count = sums.size
    if count < _LEAST_SETS:
        return None
    squares = 0.5 * (np.diff(sums) ** 2).sum() if along else (sums**2).sum()
    return float(np.sqrt(count / (count - 1) * squares) / there.sum())


def error_of_quantile(
    values: Array, level: float, sets: Labels, along: bool = False
) -> float | None:
    """Return the standard error of a quantile (Woodruff 1952).

    It is that of the share of the values below it, carried over to the values.

    Parameters
    ----------
    values, sets, along
        As for `error_of_mean`.
    level : float
        Of the quantile.

    Returns
    -------
    float or None
        None of fewer than five sets.
    """
    there = np.isfinite(values)
    if not there.any():
        return None
    middle = np.quantile(values[there], level)
    below = np.where(there, (values <= middle).astype(float), np.nan)
    off = error_of_mean(below, sets, along)
    if off is None:
        return None
    low, high = np.quantile(values[there], np.clip([level - off, level + off], 0.0, 1.0)).tolist()
    return float(0.5 * (high - low))


def share_band(held: Array, sets: Labels, along: bool = False) -> tuple[float, float] | None:
    """Return the 95 % band of a share (Korn and Graubard 1998).

    It is Clopper and Pearson's, of as many independent frames as would tell as much.

    Parameters
    ----------
    held : ndarray, shape (n,)
        1 or 0; nan where it does not count.
    sets, along
        As for `error_of_mean`.

    Returns
    -------
    tuple of float or None
        Its ends; None where nothing counts.
    """
    there = np.isfinite(held)
    total = int(there.sum())
    if not total:
        return None
    count = np.unique(sets[there]).size
    share = float(held[there].mean())
    # where every set agrees, or few are there, it cannot be told that frames are worth more than
    # their set
    effective = float(count)
    off = error_of_mean(held, sets, along)
    if off:
        student = (stats.norm.ppf(0.975) / stats.t.ppf(0.975, count - 1)) ** 2
        effective = float(np.clip(share * (1 - share) / off**2 * student, count, total))
    return band_of(share, effective)


def band_of(share: float, effective: float) -> tuple[float, float]:
    """Return the 95 % band of a share of so many independent frames (Clopper and Pearson 1934)."""
    hits, tail = share * effective, 0.5 * (1 - _LEVEL)
    low = float(stats.beta.ppf(tail, hits, effective - hits + 1)) if share > 0 else 0.0
    high = float(stats.beta.ppf(1 - tail, hits + 1, effective - hits)) if share < 1 else 1.0
    return low, high
