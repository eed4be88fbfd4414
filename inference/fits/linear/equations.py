"""Linear least squares on known ranges, weighted by what noise does to the equation itself.

Ranges come from a technique of single frames, so their errors and those of the readings are one.
Each frame gives one equation that noise would leave true; its variance follows from how it
changes with both readings, the range along with them, and the weights from a fit before.
"""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from inference.estimates import TechniqueResult
from inference.fits.linear.least_squares import LinearFit, solve_weighted
from inference.frame.arguments import instrument_of
from inference.frame.noise import covariances
from inference.technique import Task, Technique
from simulator.errors import RefusedError
from simulator.frames import Frames

__all__ = ["Equations", "Observed", "fit_equations", "without_warnings"]

Array = NDArray[np.float64]

_PASSES = 20
_STEP = 0.05  # standard deviations of a reading by which it is moved to see what follows


@dataclasses.dataclass(frozen=True, eq=False)
class Observed:
    """A linear equation of every frame: ``matrix @ x = target``, of relative size one.

    Attributes
    ----------
    matrix : ndarray, shape (n, p)
    target : ndarray, shape (n,)
    """

    matrix: Array
    target: Array


@dataclasses.dataclass(frozen=True, eq=False)
class _Response:
    """How equations change with the readings, ranges following, and the readings' noise.

    Attributes
    ----------
    matrix : ndarray, shape (n, 2, p)
        Central differences over a standard deviation of each reading.
    target : ndarray, shape (n, 2)
        The same.
    correlation : ndarray, shape (n, 2, 2)
        Of the noise.
    """

    matrix: Array
    target: Array
    correlation: Array

    def sd(self, x: Array) -> Array:
        """Return the standard deviation of each equation's sides at a solution, shape (n,)."""
        gradient = self.matrix @ x - self.target
        variance = np.einsum("ni,nij,nj->n", gradient, self.correlation, gradient)
        return np.asarray(np.sqrt(variance))


@dataclasses.dataclass(frozen=True, eq=False)
class Equations:
    """One linear equation a frame, on the ranges of a technique of single frames.

    Attributes
    ----------
    technique : Technique
        Gives the ranges; where it has several roots, the fit over all frames chooses.
    equation : callable
        (ranges, frames) -> Observed.
    signal : callable
        (ranges, frames) -> the object's part of the readings, shape (n, 2).
    unknowns : tuple of str
        Names, one a column of the equation.
    widest : float
        Relative standard deviation of a range above which its frame takes no part: first order
        does not describe what its noise does to the equation.
    """

    technique: Technique
    task: Task
    equation: Callable[[Array, Frames], Observed]
    signal: Callable[[Array, Frames], Array]
    unknowns: tuple[str, ...]
    widest: float = math.inf

    def _with(self, readings: Array, ranges: Array) -> Observed:
        """Return the equations of other readings, their ranges following."""
        frames = dataclasses.replace(self.task.frames, readings=readings)
        moved = self.technique.solve(dataclasses.replace(self.task, frames=frames, exact=True))
        return self.equation(_nearest(moved.roots_m, ranges), frames)

    def response(self, ranges: Array) -> _Response:
        """Return how the equations change with the readings at the roots chosen [m]."""
        readings, signal = self.task.frames.readings, self.signal(ranges, self.task.frames)
        v = covariances(instrument_of(self.task.sensor), readings, signal)
        sd = np.sqrt(np.einsum("nii->ni", v))
        matrices, targets = [], []
        for step in _STEP * np.eye(2):
            ahead = self._with(readings + step * sd, ranges)
            behind = self._with(readings - step * sd, ranges)
            matrices.append((ahead.matrix - behind.matrix) / (2 * _STEP))
            targets.append((ahead.target - behind.target) / (2 * _STEP))
        correlation = v / sd[:, :, None] / sd[:, None, :]
        return _Response(np.stack(matrices, axis=1), np.stack(targets, axis=1), correlation)


def _nearest(roots: Array, to: Array) -> Array:
    """Return the root of each row that is nearest to a value, nan where there is none."""
    distance = np.abs(np.log(roots) - np.log(to)[:, None])
    index = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=1)
    return np.asarray(roots[np.arange(roots.shape[0]), index])


def fit_equations(equations: Equations) -> tuple[LinearFit, TechniqueResult]:
    """Fit one equation a frame.

    Returns
    -------
    (LinearFit, TechniqueResult)
        The fit, and the technique's result for the frames as they are.

    Raises
    ------
    RefusedError
        Where fewer frames have a range than the unknowns need, or do not tell them apart.
    """
    unknowns, technique = equations.unknowns, equations.technique
    result = technique.solve(dataclasses.replace(equations.task, exact=True))
    needed = len(unknowns) + 1
    solved = int(np.count_nonzero(result.root_count))
    if solved < needed:
        raise RefusedError(
            f"needs at least {needed} frames that have a range by {technique.name} for "
            f"{', '.join(unknowns)}, and has {solved}; send more frames, or use a posterior"
        )
    with np.errstate(all="ignore"):
        starts = [result.roots_m[:, 0]]
        if (result.root_count > 1).any():
            last = np.maximum(result.root_count - 1, 0)
            starts.append(result.roots_m[np.arange(last.size), last])
        usable = result.roots_sd_m <= equations.widest * result.roots_m
        roots = np.where(usable | (equations.widest == math.inf), result.roots_m, np.nan)
        fits = [_fit_from(equations, roots, start) for start in starts]
    good = [fit for fit in fits if fit.rank == len(unknowns)]
    if not good:
        raise RefusedError(
            f"the frames do not tell {', '.join(unknowns)} apart (rank {fits[0].rank} of "
            f"{len(unknowns)}): move the object nearer and farther"
        )
    return min(good, key=lambda fit: fit.chi_square), result


def _fit_from(equations: Equations, roots: Array, ranges: Array) -> LinearFit:
    """Fit from a first choice of roots; choose and weigh anew until nothing changes."""
    frames, p = equations.task.frames, len(equations.unknowns)
    n = len(frames)
    none = np.empty(0)
    fit = LinearFit(
        np.full(p, np.nan), np.full((p, p), np.nan), 0, none, np.zeros(n, bool), ranges, none
    )
    response = equations.response(ranges)
    for turn in range(_PASSES):
        observed = equations.equation(ranges, frames)
        used = np.isfinite(observed.matrix).all(axis=1) & np.isfinite(observed.target)
        weights = np.ones(n)
        if turn > 0:
            sd = response.sd(fit.x)
            used &= np.isfinite(sd) & (sd > 0)
            weights = 1.0 / np.where(used, sd, 1.0)
        if int(used.sum()) <= p:
            return dataclasses.replace(fit, rank=0)
        matrix = observed.matrix[used] * weights[used, None]
        target = observed.target[used] * weights[used]
        x, factor, rank = solve_weighted(matrix, target)
        last, fit = (
            fit,
            LinearFit(
                # equations of light are of one, known parts and all
                x,
                factor,
                rank,
                matrix @ x - target,
                used,
                ranges,
                weights[used],
            ),
        )
        if rank < p:
            return fit
        chosen = _best_roots(equations, roots, x)
        if not np.array_equal(chosen, ranges, equal_nan=True):
            ranges, response = chosen, equations.response(chosen)
        elif turn > 1 and np.allclose(last.x, x, rtol=1e-10, atol=0.0):
            break
    return fit


def _best_roots(equations: Equations, roots: Array, x: Array) -> Array:
    """Return the root of each frame that leaves its equation nearest to true."""
    misses = []
    for k in range(roots.shape[1]):
        observed = equations.equation(roots[:, k], equations.task.frames)
        miss = np.abs(observed.matrix @ x - observed.target)
        misses.append(np.where(np.isnan(miss), np.inf, miss))
    index = np.argmin(np.stack(misses, axis=1), axis=1)
    return np.asarray(roots[np.arange(roots.shape[0]), index])


def without_warnings(
    solve: Callable[[Task], TechniqueResult],
) -> Callable[[Task], TechniqueResult]:
    """Wrap a solver so that overflow shows in its numbers, which `linear_answer` judges.

    Parameters
    ----------
    solve : callable
        Task -> TechniqueResult.
    """

    @functools.wraps(solve)
    def quiet(task: Task) -> TechniqueResult:
        with np.errstate(all="ignore"):
            return solve(task)

    return quiet
