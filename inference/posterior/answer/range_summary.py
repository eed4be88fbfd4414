"""Draws of the ranges in a few numbers each, of which none is an average over two modes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inference.posterior.answer.draws import Draws
from inference.posterior.answer.error_parts import ErrorParts, of_sd
from inference.posterior.answer.posterior import RANGE_COLUMNS, RangeMode, RangeSummary
from inference.posterior.answer.precision import mean_error, quantile_error
from inference.posterior.answer.quantiles import QUANTILES, quantiles
from inference.posterior.answer.separation import boundaries, labels
from inference.posterior.answer.shares import resampled_share_error, share_error

__all__ = ["joined", "range_summary"]

Array = NDArray[np.float64]


def range_summary(
    draws: Draws,
    near_fold: NDArray[np.bool_],
    resampled: Array | None,
    shares: ErrorParts,
    start: float | None = None,
) -> RangeSummary:
    """Summarise the ranges of all frames of a job.

    Parameters
    ----------
    draws : Draws
        Draws of the ranges.
    near_fold : ndarray of bool, shape (frames,)
        Frames near a fold.
    resampled : ndarray, shape (1, 1, steps), or None
        With importance sampling: weights of the draws that those of the parameters were resampled
        from.
    shares : ErrorParts of ndarray, shape (frames,)
        Of the standard deviations.
    start : float or None
        Of walkers, as of `effective_sample_size`.
    """
    n = draws.range_m.shape[-1]
    columns = {name: np.full(n, np.nan) for name in RANGE_COLUMNS}
    modes: list[tuple[RangeMode, ...]] = [()] * n
    weights = None if resampled is None else resampled[..., draws.thinned]
    for frame in np.flatnonzero(np.isfinite(draws.range_m[0, 0, 0])):
        r = draws.range_m[..., frame]
        cuts = boundaries(np.log(r).ravel())
        modes[frame] = _modes(r, labels(np.log(r), cuts), cuts.size + 1, weights, start)
        q = quantiles(r, several_modes=cuts.size > 0)
        for at, value in zip(QUANTILES, q, strict=True):
            name = f"q{100 * at:02.0f}"
            columns[name][frame] = value
            columns[f"mcse_{name}"][frame] = quantile_error(r, at, weights, start)
        if cuts.size == 0:
            columns["mean"][frame], columns["sd"][frame] = r.mean(), r.std(ddof=1)
            columns["mcse_mean"][frame] = mean_error(r, weights, start)
    parts = of_sd(shares, columns["sd"])
    return RangeSummary(**columns, sd_parts=parts, near_fold=near_fold, modes=tuple(modes))


def joined(
    parts: Sequence[RangeSummary], numbers: Sequence[NDArray[np.intp]], n: int
) -> RangeSummary:
    """Put together the summaries of parts of n frames, given the numbers of the frames of each."""

    def whole(values: Sequence[NDArray[Any]], empty: Any) -> NDArray[Any]:
        result = np.full(n, empty)
        for at, value in zip(numbers, values, strict=True):
            result[at] = value
        return result

    columns = {
        name: whole([getattr(part, name) for part in parts], np.nan) for name in RANGE_COLUMNS
    }
    shares = [
        whole([getattr(part.sd_parts, name) for part in parts], np.nan)
        for name in ("noise", "scene", "model")
    ]
    modes: list[tuple[RangeMode, ...]] = [()] * n
    for at, part in zip(numbers, parts, strict=True):
        for number, mode in zip(at.tolist(), part.modes, strict=True):
            modes[number] = mode
    folds = whole([part.near_fold for part in parts], empty=False)
    return RangeSummary(
        **columns, sd_parts=ErrorParts(*shares), near_fold=folds, modes=tuple(modes)
    )


def _modes(
    r: Array,
    label: NDArray[np.intp],
    count: int,
    weights: Array | None,
    start: float | None,
) -> tuple[RangeMode, ...]:
    result = []
    for k in range(count):
        inside = label == k
        weight = float(inside.mean())
        error = (
            share_error(inside, start)
            if weights is None
            else resampled_share_error(inside, weights)
        )
        q05, q50, q95 = quantiles(r[inside], several_modes=False)
        sd = float(r[inside].std(ddof=1)) if inside.sum() > 1 else 0.0
        result.append(RangeMode(q50, weight, error, sd, q05, q95))
    return tuple(result)
