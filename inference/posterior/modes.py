"""Modes of a range: which of its draws belong together, labelled by range, never by weight."""

import numpy as np
from numpy.typing import NDArray

from inference.posterior.posterior import Mode

__all__ = ["range_modes"]

Array = NDArray[np.float64]

_NEIGHBOURS = 20  # draws on either side that a gap is held against
_GAP = 2.0  # times their span


def range_modes(ranges: Array) -> tuple[Mode, ...]:
    """Group the draws of one range into modes separated by empty stretches of log r.

    A gap between two neighbouring draws separates modes where it is wider than twice the span of
    the ten draws on either side; among draws of one smooth density that happens by chance with
    probability 3^-20 a gap. Modes of fewer than twenty draws are not told apart from tails.

    Parameters
    ----------
    ranges : ndarray, shape (n,)
        Draws of a range [m].

    Returns
    -------
    tuple of Mode
        By ascending range: the median of each mode and its share of the draws.
    """
    ordered = np.sort(ranges)
    logs = np.log(ordered)
    n, m = logs.size, _NEIGHBOURS
    if n < 2 * m:
        return (Mode(float(np.median(ordered)), 1.0),)
    # gap k lies between draws k and k + 1; the m draws on either side of it end and begin there
    index = np.arange(m - 1, n - m)
    gap = logs[index + 1] - logs[index]
    span = np.maximum(
        logs[index] - logs[index - m + 1],
        logs[np.minimum(index + m, n - 1)] - logs[index + 1],
    )
    cuts = index[(gap > _GAP * span) & (gap > 0)] + 1
    return tuple(Mode(float(np.median(group)), group.size / n) for group in np.split(ordered, cuts))
