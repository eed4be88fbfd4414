"""Draws of the ranges in a few numbers each."""

import numpy as np
from numpy.typing import NDArray

from inference.posterior.job import Job
from inference.posterior.modes import range_modes
from inference.posterior.posterior import Mode, RangeSummary

__all__ = ["range_summary"]

Array = NDArray[np.float64]


def range_summary(job: Job, drawn: Array) -> RangeSummary:
    """Summarise the ranges of all frames of a job.

    Parameters
    ----------
    job : Job
        The job.
    drawn : ndarray, shape (m, usable frames)
        Draws of log r; nan for a frame without object.

    Returns
    -------
    RangeSummary
    """
    usable = np.flatnonzero(job.usable)
    ranges = np.exp(drawn)
    n = len(job.frames)
    columns = {name: np.full(n, np.nan) for name in ("q05", "q50", "q95", "mean", "sd")}
    modes: list[tuple[Mode, ...]] = [()] * n
    for j, frame in enumerate(usable):
        r = ranges[:, j]
        if not np.isfinite(r[0]):
            continue
        columns["q05"][frame], columns["q50"][frame], columns["q95"][frame] = np.quantile(
            r, [0.05, 0.5, 0.95]
        )
        columns["mean"][frame], columns["sd"][frame] = r.mean(), r.std(ddof=1)
        modes[frame] = range_modes(r)
    return RangeSummary(**columns, modes=tuple(modes))
