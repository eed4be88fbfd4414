"""Linear least squares on known ranges, weighted by what noise does to the equation itself.

Ranges come from a technique of single frames, so their errors and those of the readings are one.
Each frame gives one equation that noise would leave true; its variance follows from how it
changes with both readings, the range along with them, and the weights from a fit before.
"""

import dataclasses
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

__all__ = ["Equations", "Observed", "fit_equations"]

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
class Equations:
    """One linear equation a frame, on the ranges of a technique of single frames.

    Attributes
    ----------
    technique : Technique
        Gives the ranges; where it has several roots, the fit over all frames chooses.
    task : Task
        The request.
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

    def slopes(self, ranges: Array) -> tuple[Observed, Observed, Array]:
        """Return how the equations change with the first and the second reading.

        Parameters
        ----------
        ranges : ndarray, shape (n,)
            The roots chosen [m].

        Returns
        -------
        (Observed, Observed, ndarray)
            Central differences over a standard deviation of each reading, ranges following, and
            the correlation of the readings' noise, shape (n, 2, 2).
        """
        task = self.task
        readings, signal = task.frames.readings, self.signal(ranges, task.frames)
        v = covariances(instrument_of(task.sensor), readings, signal)
        sd = np.sqrt(np.einsum("nii->ni", v))
        slopes = []
        for k in (0, 1):
            ends = []
            for sign in (1.0, -1.0):
                moved_readings = readings.copy()
                moved_readings[:, k] += sign * _STEP * sd[:, k]
                frames = dataclasses.replace(task.frames, readings=moved_readings)
                moved = self.technique.solve(dataclasses.replace(task, frames=frames))
                ends.append(self.equation(_nearest(moved.roots_m, ranges), frames))
            slopes.append(
                Observed(
                    (ends[0].matrix - ends[1].matrix) / (2 * _STEP),
                    (ends[0].target - ends[1].target) / (2 * _STEP),
                )
            )
        return slopes[0], slopes[1], v / sd[:, :, None] / sd[:, None, :]


def _nearest(roots: Array, to: Array) -> Array:
    """Return the root of each row that is nearest to a value, nan where there is none."""
    distance = np.abs(np.log(roots) - np.log(to)[:, None])
    index = np.argmin(np.where(np.isnan(distance), np.inf, distance), axis=1)
    return np.asarray(roots[np.arange(roots.shape[0]), index])


def fit_equations(equations: Equations) -> tuple[LinearFit, TechniqueResult]:
    """Fit one equation a frame.

    Parameters
    ----------
    equations : Equations
        The equations.

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
    result = technique.solve(equations.task)
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
    fit = LinearFit(
        np.full(p, np.nan), np.full((p, p), np.nan), 0, np.empty(0), np.zeros(n, bool), ranges
    )
    slopes = equations.slopes(ranges)
    for turn in range(_PASSES):
        observed = equations.equation(ranges, frames)
        used = np.isfinite(observed.matrix).all(axis=1) & np.isfinite(observed.target)
        weights = np.ones(n)
        if turn > 0:
            gradient = np.stack([s.matrix @ fit.x - s.target for s in slopes[:2]], axis=1)
            sd = np.sqrt(np.einsum("ni,nij,nj->n", gradient, slopes[2], gradient))
            used &= np.isfinite(sd) & (sd > 0)
            weights = 1.0 / np.where(used, sd, 1.0)
        if int(used.sum()) <= p:
            return dataclasses.replace(fit, rank=0)
        matrix = observed.matrix[used] * weights[used, None]
        target = observed.target[used] * weights[used]
        x, factor, rank = solve_weighted(matrix, target)
        last, fit = fit, LinearFit(x, factor, rank, matrix @ x - target, used, ranges)
        if rank < p:
            return fit
        chosen = _best_roots(equations, roots, x)
        if not np.array_equal(chosen, ranges, equal_nan=True):
            ranges, slopes = chosen, equations.slopes(chosen)
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
