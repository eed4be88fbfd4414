"""Draws of the parameters in a few numbers each, of which none is an average over two modes."""

import math

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.error_parts import ErrorParts, ParameterErrorParts
from inference.posterior.answer.posterior import ParameterMode, ParameterSummary
from inference.posterior.answer.quantiles import quantiles, weighted_quantiles
from inference.posterior.answer.separation import boundaries, labels
from inference.posterior.answer.shares import share_error, weighted_share_error
from inference.posterior.sampling.by_weight import heavy
from inference.posterior.sampling.diagnostics import (
    effective_sample_size,
    split_r_hat,
    tail_effective_sample_size,
)
from inference.posterior.sampling.importance import weighted_sizes

__all__ = ["summaries_of_chains", "summaries_of_weights"]

Array = NDArray[np.float64]

_FEWEST = 1000  # draws among which modes are looked for: of one walker they are far apart


def summaries_of_chains(
    names: tuple[str, ...],
    draws: Array,
    moved: Array,
    shares: ErrorParts,
    start: float | None = None,
) -> dict[str, ParameterSummary]:
    """Summarise the draws of ensembles.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    draws : ndarray, shape (ensembles, walkers, steps, d)
        In SI units, as the ensembles drew them: what tells how well they mixed.
    moved : ndarray, shape (ensembles, walkers, steps, d)
        The same with the errors of the model: what is reported.
    shares : ErrorParts of ndarray, shape (d,)
        Of the standard deviations.
    start : float or None
        As of `effective_sample_size`.
    """
    ensembles, walkers, steps, _ = draws.shape
    result = {}
    for j, name in enumerate(names):
        drawn, x = draws[..., j], moved[..., j]
        ess = effective_sample_size(drawn, start)
        # as many as are independent: a mode of a thousandth has ten of ten thousand
        looked_at = max(ess, _FEWEST) if math.isfinite(ess) else _FEWEST
        each = min(math.ceil(looked_at / (ensembles * walkers)), steps)
        thin = np.linspace(0, steps - 1, each).astype(np.intp)
        cuts = boundaries(x[:, :, thin].ravel())
        label = labels(x, cuts)
        modes = tuple(
            _mode(x[label == k], None, float((label == k).mean()), share_error(label == k, start))
            for k in range(cuts.size + 1)
        )
        several = cuts.size > 0
        q05, q50, q95 = quantiles(x, several)
        sd = float(x.std(ddof=1))
        result[name] = ParameterSummary(
            math.nan if several else float(x.mean()),
            math.nan if several else sd,
            _parts(shares, j, math.nan if several else sd),
            q05,
            q50,
            q95,
            ess,
            tail_effective_sample_size(drawn, start),
            split_r_hat(drawn),
            math.nan if several else sd / math.sqrt(ess),
            modes,
        )
    return result


def _parts(shares: ErrorParts, j: int, sd: float) -> ParameterErrorParts:
    """Return what the standard deviation of one parameter is made of."""
    parts = (shares.noise, shares.scene, shares.model)
    return ParameterErrorParts(*(sd * float(part[j]) for part in parts))


def summaries_of_weights(
    names: tuple[str, ...], x: Array, weights: Array, shares: ErrorParts
) -> dict[str, ParameterSummary]:
    """Summarise weighted draws.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    x : ndarray, shape (n, d)
        Draws in SI units, with the errors of the model.
    weights : ndarray, shape (n,)
        Sum to one.
    shares : ErrorParts of ndarray, shape (d,)
        Of the standard deviations.

    Returns
    -------
    dict of str to ParameterSummary
        R-hat is None; effective sample sizes are those of weighted draws.
    """
    carry = heavy(weights)
    result = {}
    for j, name in enumerate(names):
        column = x[:, j]
        cuts = boundaries(column[carry])
        label = labels(column, cuts)
        modes = []
        for k in range(cuts.size + 1):
            inside = label == k
            share = min(float(weights[inside].sum()), 1.0)
            error = weighted_share_error(inside, weights)
            modes.append(_mode(column[inside], weights[inside] / share, share, error))
        several = cuts.size > 0
        mean = float(weights @ column)
        variance = float(weights @ (column - mean) ** 2)
        error = float(np.sqrt(weights**2 @ (column - mean) ** 2))
        q05, q50, q95 = weighted_quantiles(column, weights, several)
        result[name] = ParameterSummary(
            math.nan if several else mean,
            math.nan if several else math.sqrt(variance),
            _parts(shares, j, math.nan if several else math.sqrt(variance)),
            q05,
            q50,
            q95,
            *weighted_sizes(column, weights),
            None,
            math.nan if several else error,
            tuple(modes),
        )
    return result


def _mode(x: Array, weights: Array | None, share: float, error: float | None) -> ParameterMode:
    """Describe the draws of one mode."""
    w = np.full(x.size, 1.0 / x.size) if weights is None else weights
    q05, q50, q95 = weighted_quantiles(x, w, several_modes=False)
    sd = float(np.sqrt(w @ (x - w @ x) ** 2))
    return ParameterMode(q50, share, error, sd, q05, q95)
