"""How a linear fit follows errors of its model: the same fit of readings that are moved by them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.model_error import erring_flux, shadow_of, share_left
from inference.fits.likelihood.problem import fit_problem
from inference.technique import Task
from simulator.discrepancy import DiscrepancyBasis, discrepancy_basis
from simulator.errors import RefusedError

__all__ = ["Follow"]

Array = NDArray[np.float64]

_NEGLECTED = 1e-3  # of the largest error that the frames show
_STEP = 1e-3  # standard deviations of an error by which readings are moved


def _shown(basis: DiscrepancyBasis, log_r: Array) -> Array:
    """Return as many errors as the ranges of frames show, two of a kind, as columns of all."""
    values = basis.values(log_r[np.isfinite(log_r)])
    _, sizes, turn = scipy.linalg.svd(values, full_matrices=False)
    return np.asarray(np.kron(np.eye(2), turn[sizes > _NEGLECTED * sizes[0]].T))


@dataclasses.dataclass(frozen=True, eq=False)
class Follow:
    """A fit, and the light on which errors of its model act.

    Attributes
    ----------
    fit : callable
        Task -> values, shape (p,), and weighted residuals, shape (m,).
    ranges : ndarray, shape (n,)
        Of its frames [m]; nan where it uses none.
    light, slopes : ndarray, shape (n, 2)
        The object's part of the readings there, and its derivative along log r.
    """

    fit: Callable[[Task], tuple[Array, Array]]
    ranges: Array
    light: Array
    slopes: Array

    def changes(self, task: Task) -> tuple[Array, Array, float]:
        """Return changes along independent standard normal errors.

        Returns
        -------
        (ndarray, ndarray, float)
            Of values, shape (p, k), and of residuals, shape (m, k); the share of
            what errors take up that may be left (`share_left`).

        Raises
        ------
        RefusedError
            Where the moved readings are fitted with other frames.
        """
        problem, log_r = fit_problem(task.sensor, task.scene, task.frames), np.log(self.ranges)
        none = task.exact or not problem.erring
        if none or np.isnan(log_r).all():
            values, residuals = self.fit(task)
            return np.empty((values.size, 0)), np.empty((residuals.size, 0)), 0.0
        at = np.isfinite(log_r)[:, None]
        light, slopes = np.where(at, self.light, 0.0), np.where(at, self.slopes, 0.0)
        turn = _shown(discrepancy_basis(*problem.parameters.reach_m), log_r)
        erring = erring_flux(problem, log_r)
        steps = _STEP * erring.of_light(light) @ turn
        seen = task.frames.derivatives
        rates = np.zeros_like(steps)
        if seen is not None:  # as fast as the derivatives say that log r changes
            size = np.square(slopes).sum(axis=1)
            rate = np.einsum("ni,ni->n", slopes, seen) / np.where(size > 0, size, 1.0)
            moved = erring.slopes_of_light(light, slopes)
            rates = _STEP * rate[:, None, None] * moved @ turn
        shadow = shadow_of(problem, problem.layout.known, log_r)
        if shadow is not None:  # before a known background
            more = _shown(shadow.basis, log_r)
            moved = _STEP * problem.unit * shadow.columns @ more
            steps = np.concatenate([steps, moved], axis=2)
            rates = np.concatenate([rates, np.zeros_like(moved)], axis=2)
            turn = scipy.linalg.block_diag(turn, more)
        found: list[list[Array]] = []
        for k in range(steps.shape[2]):
            ends = []
            for sign in (1.0, -1.0):
                frames = dataclasses.replace(
                    task.frames,
                    readings=task.frames.readings + sign * steps[:, :, k],
                    derivatives=None if seen is None else seen + sign * rates[:, :, k],
                )
                ends.append(self.fit(dataclasses.replace(task, frames=frames)))
            if ends[0][1].shape != ends[1][1].shape:
                raise RefusedError(
                    "an error of the model decides which frames have a range; take joint_fit"
                )
            found.append([(a - b) / (2 * _STEP) for a, b in zip(*ends, strict=True)])
        values, residuals = (np.stack(column, axis=1) for column in zip(*found, strict=True))
        return values @ turn.T, residuals @ turn.T, share_left(problem, log_r)
