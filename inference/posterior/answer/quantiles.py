"""Quantiles of draws, of which none falls between two modes."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTILES", "quantiles", "weighted_quantiles"]

Array = NDArray[np.float64]

QUANTILES = (0.05, 0.5, 0.95)


def quantiles(draws: Array, several_modes: bool) -> tuple[float, float, float]:
    """Return the quantiles at 5, 50 and 95 % of equally weighted draws.

    Parameters
    ----------
    draws : ndarray
        Of any shape.
    several_modes : bool
        Whether the draws have several separate modes; a quantile is then one of the draws.
    """
    method: Literal["inverted_cdf", "linear"] = "inverted_cdf" if several_modes else "linear"
    q05, q50, q95 = np.quantile(draws.ravel(), np.array(QUANTILES), method=method).tolist()
    return q05, q50, q95


def weighted_quantiles(
    draws: Array, weights: Array, several_modes: bool
) -> tuple[float, float, float]:
    """Return the quantiles at 5, 50 and 95 % of weighted draws.

    Parameters
    ----------
    draws, weights : ndarray, shape (n,)
        Draws, and their weights, which sum to one.
    several_modes : bool
        As for `quantiles`.
    """
    order = np.argsort(draws)
    cumulative = np.cumsum(weights[order])
    if several_modes:
        index = np.minimum(np.searchsorted(cumulative, QUANTILES), draws.size - 1)
        q05, q50, q95 = draws[order][index].tolist()
    else:
        middle = cumulative - 0.5 * weights[order]
        q05, q50, q95 = np.interp(QUANTILES, middle, draws[order]).tolist()
    return q05, q50, q95
