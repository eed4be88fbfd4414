"""Where readings are met best with errors of the model as unknowns, climbed to from a draw."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from inference.identifiability.experiment import Experiment
from inference.identifiability.response_rows import ResponseRows

__all__ = ["joint_optimum"]

Array = NDArray[np.float64]

_STEPS = 300
_TRIES = 20  # of one step, each damped four times as much
_DAMPED = 1e-2  # at first, in units of the priors
_GAINED = 0.003  # of the deviance, by a step that is the last
_FARTHEST = 30.0  # standard deviations of a prior: farther lengths are no numbers any more


def joint_optimum(
    experiment: Experiment, readings: Array, steps: int = _STEPS
) -> tuple[Experiment, float]:
    """Climb over unknowns, ranges and errors of the model together (Levenberg and Marquardt).

    Parameters
    ----------
    experiment : Experiment
        Where to begin, with the sizes of its errors.
    readings : ndarray, shape (n, 2 or 4)
        As for `inference.identifiability.model_response.model_response`.
    steps : int
        At most so many.

    Returns
    -------
    (Experiment, float)
        The end with its errors, and its deviance: squares of what readings, priors and errors are
        off, in standard deviations.
    """
    if experiment.error is None:
        none = np.zeros(experiment.by_error.shape[2])
        experiment = dataclasses.replace(experiment, error=none)
    here, damping = ResponseRows(experiment), 0.0
    last = _deviance(here, readings)
    for _ in range(steps):
        for _ in range(_TRIES):
            there = ResponseRows(_stepped(here, readings, damping))
            with np.errstate(all="ignore"):
                following = _deviance(there, readings)
            if following < last:
                break
            damping = max(4.0 * damping, _DAMPED)
        else:
            break
        here, gained, last = there, last - following, following
        damping = 0.25 * damping if damping > _DAMPED else 0.0
        if gained < _GAINED:
            break
    return here.experiment, last


def _deviance(rows: ResponseRows, readings: Array) -> float:
    e = rows.experiment
    assert e.error is not None  # noqa: S101  # it has been begun with
    if not (e.finite and np.isfinite(e.error).all()):
        return math.inf
    parts = rows.residual(readings), e.z, e.error
    value = float(sum(np.square(part).sum() for part in parts))
    return value if math.isfinite(value) else math.inf


def _stepped(rows: ResponseRows, readings: Array, damping: float) -> Experiment:
    """Return where a step leads, the ranges eliminated."""
    e, along, off = rows.experiment, rows.along, rows.residual(readings)
    assert e.error is not None  # noqa: S101
    both = np.concatenate([rows.jacobian, rows.by_error], axis=2)
    square = np.square(along).sum(axis=1)
    told = square > 0
    inverse = np.divide(1.0, square, out=np.zeros(square.size), where=told)
    free = (
        both
        - along[:, :, None] * (inverse[:, None] * np.einsum("nm,nmk->nk", along, both))[:, None]
    )
    left = off - along * (inverse * np.einsum("nm,nm->n", along, off))[:, None]
    size, at = both.shape[2], np.concatenate([e.z, e.error])
    one = np.eye(size)
    whole = np.concatenate([free.reshape(-1, size), one, math.sqrt(damping) * one])
    target = np.concatenate([left.ravel(), -at, np.zeros(size)])
    step = np.linalg.lstsq(whole, target, rcond=None)[0]
    moved = inverse * np.einsum("nm,nm->n", along, off - both @ step)
    d = e.z.size
    return dataclasses.replace(
        e,
        z=np.clip(e.z + step[:d], -_FARTHEST, _FARTHEST),
        log_r=e.log_r + np.clip(moved, -1.0, 1.0),
        error=e.error + step[d:],
    )
