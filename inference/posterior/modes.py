"""Modes of a range: which of its draws belong together, labelled by range, never by weight."""

import numpy as np
from numpy.typing import NDArray

from inference.posterior.posterior import Mode

__all__ = ["range_modes"]

Array = NDArray[np.float64]

_LEAST_WEIGHT = 0.005
_SEPARATION = 4.0  # standard deviations between two modes' tops


def range_modes(log_r: Array, tops: Array, widths: Array) -> tuple[Mode, ...]:
    """Group the draws of one range by the mode that each was drawn from.

    Parameters
    ----------
    log_r : ndarray, shape (n,)
        Draws of log r.
    tops, widths : ndarray, shape (n,)
        log r at the top of the mode that each was drawn from, and its standard deviation.

    Returns
    -------
    tuple of Mode
        By ascending range; those below half a percent left out. Over the draws of the parameters
        one mode's tops form a chain without gaps; a gap of several widths separates two modes.
    """
    order = np.argsort(tops)
    log_r, tops, widths = log_r[order], tops[order], widths[order]
    gaps = np.diff(tops)
    # the spread of the tops within a chain counts as well as the widths of single modes
    typical = np.maximum(widths[:-1], widths[1:]) + _local_spread(gaps)
    groups = np.split(np.arange(tops.size), np.flatnonzero(gaps > _SEPARATION * typical) + 1)
    kept = [group for group in groups if group.size >= _LEAST_WEIGHT * tops.size]
    total = sum(group.size for group in kept)
    return tuple(Mode(float(np.exp(np.median(log_r[g]))), g.size / total) for g in kept)


def _local_spread(gaps: Array) -> Array:
    """Return the larger of the median gaps of the fifty neighbours on either side."""
    spread = np.empty(gaps.size)
    for k in range(gaps.size):
        left = gaps[max(k - 50, 0) : k]
        right = gaps[k + 1 : k + 51]
        spread[k] = max(
            (float(np.median(part)) for part in (left, right) if part.size), default=0.0
        )
    return spread
