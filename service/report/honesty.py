"""What a share of intervals that hold the truth can tell, given how many sets it comes from."""

import numpy as np

from service.report.scores import Scores

__all__ = ["LEAST", "WIDE", "band_in_words", "judged", "range_in_words"]

LEAST = 0.8
"""Of a 90 % interval: the least share that counts as holding the truth."""
WIDE = 0.97
"""Of a 90 % interval: a greater share means that it is wider than it need be."""


def judged(scores: Scores) -> bool | None:
    """Tell whether 90 % intervals hold the truth in 80 % of frames or more.

    Parameters
    ----------
    scores : Scores
        With the band of the share.

    Returns
    -------
    bool or None
        None where the band has both: too few sets to tell.
    """
    low, high = scores.coverage_low, scores.coverage_high
    if low is None or high is None:
        return None
    return True if low >= LEAST else False if high < LEAST else None


def band_in_words(scores: Scores) -> str:
    """Return the band of the share in percent, ends rounded outwards."""
    low, high = scores.coverage_low, scores.coverage_high
    return "-" if low is None or high is None else range_in_words(low, high)


def range_in_words(low: float, high: float) -> str:
    """Return a band in percent, ends rounded outwards."""
    return f"{np.floor(100 * low):.0f}-{np.ceil(100 * high):.0f} %"
