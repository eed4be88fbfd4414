"""Ranges that readings prefer, moved to where what is known of them beside the readings counts."""

import numpy as np
from numpy.typing import NDArray

from inference.fits.likelihood.erring_point import linearised, whitened_of
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import Told, step_of, told_of

__all__ = ["once", "with_known"]

Array = NDArray[np.float64]

_TURNS = 60  # enough to cross all ranges of a scene, and to settle
_LONGEST = 0.3  # of log r in a turn
_SETTLED = 1e-9  # in log r
_SAME = 1e-5  # of log r, to which a descent is sure of where it ends
_NEAR = 0.1  # standard deviations, below which a step is taken as it is


def once(u: Array) -> Array:
    """Return modes of frames, nan in place of those that have come where another has.

    Parameters
    ----------
    u : ndarray, shape (n, modes)
        log r; nan where there is no mode.
    """
    u = u.copy()
    for k in range(1, u.shape[1]):
        u[(np.abs(u[:, :k] - u[:, k : k + 1]) < _SAME).any(axis=1), k] = np.nan
    return u


def with_known(problem: FitProblem, x: Array, a: Array, u: Array) -> Array:
    """Descend from ranges along each frame's deviance, what is known of its range included.

    A step that does not lower the deviance is shortened: where readings and knowledge prefer
    ranges far from each other there is a mode wherever the deviance has one, and nowhere between.

    Parameters
    ----------
    problem : FitProblem
        With the readings that there are.
    x, a : ndarray, shape (d,), (k,)
        Coordinates and errors, which stay.
    u : ndarray, shape (n,)
        log r.

    Returns
    -------
    ndarray, shape (n,)
        As ``u`` in frames of whose ranges nothing else is known.
    """
    known = problem.known
    if known is None or not (np.isfinite(u) & (known.rates > 0).any(axis=1)).any():
        return u
    told = told_of(known, u, a)
    low, high = np.log(problem.support)
    damp = np.ones(u.size)
    residual, _, along, errors, _ = linearised(problem, x, u, a)
    for _ in range(_TURNS):
        parts = np.stack([residual - errors @ a, np.where(np.isfinite(along), along, 0.0)], axis=2)
        white = whitened_of(problem, u, errors, parts)
        step, size = step_of(told, white[:, :, 0], white[:, :, 1])
        near = np.square(step) * size < _NEAR**2
        damp[near] = 1.0
        new = np.clip(u + damp * np.clip(step, -_LONGEST, _LONGEST), low, high)
        if not (np.abs(new - u) > _SETTLED).any():
            break
        there = told_of(known, new, a)
        aside = linearised(problem, x, new, a)
        # with the covariances of where it was, as the step
        off = aside[0] - aside[3] @ a
        moved = whitened_of(problem, u, errors, off[:, :, None])[:, :, 0]
        # there a step of slopes that are near enough ends where slopes are zero, as a climb does
        less = near | (_deviance(there, moved) < _deviance(told, white[:, :, 0]))
        u = np.where(less, new, u)
        residual = np.where(less[:, None], aside[0], residual)
        along = np.where(less[:, None], aside[2], along)
        errors = np.where(less[:, None, None], aside[3], errors)
        told = Told(
            *(np.where(_like(less, part), part, old) for part, old in zip(there, told, strict=True))
        )
        damp = np.where(less, np.minimum(2.0 * damp, 1.0), 0.25 * damp)
    return u


def _like(less: NDArray[np.bool_], part: Array) -> NDArray[np.bool_]:
    return less.reshape(-1, *(1,) * (part.ndim - 1))


def _deviance(told: Told, residual: Array) -> Array:
    return np.asarray(np.square(residual).sum(axis=1) + np.square(told.residual).sum(axis=1))
