"""Draws of the parameters in a few numbers each."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.diagnostics import (
    effective_sample_size,
    split_r_hat,
    tail_effective_sample_size,
)
from inference.posterior.posterior import ParameterSummary

__all__ = ["summaries_of_chains", "summaries_of_weights"]

Array = NDArray[np.float64]


def _weighted_quantiles(x: Array, weights: Array) -> list[float]:
    order = np.argsort(x)
    cumulative = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(q, cumulative, x[order])) for q in (0.05, 0.5, 0.95)]


def summaries_of_chains(names: tuple[str, ...], draws: Array) -> dict[str, ParameterSummary]:
    """Summarise the draws of ensembles.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    draws : ndarray, shape (ensembles, walkers, steps, d)
        In SI units.

    Returns
    -------
    dict of str to ParameterSummary
    """
    result = {}
    for j, name in enumerate(names):
        x = draws[..., j]
        q05, q50, q95 = (float(q) for q in np.quantile(x, [0.05, 0.5, 0.95]))
        ess = effective_sample_size(x)
        sd = float(x.std(ddof=1))
        result[name] = ParameterSummary(
            float(x.mean()),
            sd,
            q05,
            q50,
            q95,
            ess,
            tail_effective_sample_size(x),
            split_r_hat(x),
            sd / math.sqrt(ess),
        )
    return result


def summaries_of_weights(
    names: tuple[str, ...], x: Array, weights: Array
) -> dict[str, ParameterSummary]:
    """Summarise weighted draws.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    x : ndarray, shape (n, d)
        Draws in SI units.
    weights : ndarray, shape (n,)
        Sum to one.

    Returns
    -------
    dict of str to ParameterSummary
        R-hat is None; effective sample sizes are importance sample sizes.
    """
    ess = float(1 / np.sum(weights**2))
    result = {}
    for j, name in enumerate(names):
        mean = float(weights @ x[:, j])
        variance = float(weights @ (x[:, j] - mean) ** 2)
        error = float(np.sqrt(weights**2 @ (x[:, j] - mean) ** 2))
        q05, q50, q95 = _weighted_quantiles(x[:, j], weights)
        result[name] = ParameterSummary(
            mean, math.sqrt(variance), q05, q50, q95, ess, ess, None, error
        )
    return result
