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
from scipy import linalg

from inference.estimates import TechniqueResult
from inference.technique import Task, Technique
from simulator.errors import RefusedError, listed
from simulator.frames import Frames
from simulator.sensor import PulsedSensor, Sensor

__all__ = [
    "Equations",
    "LinearFit",
    "Observed",
    "covariances",
    "fit_equations",
    "refuse_at_rest",
    "solve_weighted",
    "whitener_of",
]

Array = NDArray[np.float64]

_PASSES = 20
_STEP = 0.05  # standard deviations of a reading by which it is moved to see what follows
_ROUNDING = 1e-12
_STILL = 4.0  # variance of the ranges over that of their noise up to which an object is at rest


@dataclasses.dataclass(frozen=True, eq=False)
class LinearFit:
    """Result of linear least squares.

    Attributes
    ----------
    x : ndarray, shape (p,)
        Solution.
    factor : ndarray, shape (p, p)
        F with F F^T its covariance.
    rank : int
        Of the weighted matrix.
    residuals : ndarray, shape (m,)
        Weighted: of unit variance where the model holds.
    used : ndarray of bool, shape (n,)
        Frames that took part.
    ranges : ndarray, shape (n,)
        The root of each frame that the fit chose [m], nan where there is none.
    """

    x: Array
    factor: Array
    rank: int
    residuals: Array
    used: NDArray[np.bool_]
    ranges: Array

    @property
    def chi_square(self) -> float:
        """Sum of squares of the weighted residuals."""
        return float(self.residuals @ self.residuals)


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


def covariances(sensor: Sensor, readings: Array, signal: Array) -> Array:
    """Return the covariance of every frame's readings, shape (n, 2, 2).

    Parameters
    ----------
    sensor : Sensor
        Its noise.
    readings : ndarray, shape (n, 2)
        As measured, in place of their means.
    signal : ndarray, shape (n, 2)
        The object's part, to which the relative error belongs.
    """
    noise = sensor.noise
    out = noise.relative**2 * signal[:, :, None] * signal[:, None, :]
    shot = noise.shot * np.abs(readings)
    for k in (0, 1):
        out[:, k, k] += noise.read[k] ** 2 + shot[:, k]
    if isinstance(sensor, PulsedSensor):
        shared = shot.min(axis=1)
        out[:, 0, 1] += shared
        out[:, 1, 0] += shared
    return np.asarray(out)


def whitener_of(own: Array, common: Array) -> Array:
    """Return W with W^T W the inverse of own + the sum of a a^T over a of common.

    Parameters
    ----------
    own : ndarray, shape (n, 2, 2)
        Covariances.
    common : ndarray, shape (k, n, 2)
        May be a million times the rest: never added to it.

    Returns
    -------
    ndarray, shape (n, 2, 2)
    """
    result = np.linalg.inv(np.linalg.cholesky(own))
    for along in common:
        w = np.einsum("nij,nj->ni", result, along)
        root = np.hypot(1.0, np.hypot(w[:, 0], w[:, 1]))
        # (I + w w^T)^(-1/2) = I - w w^T / (root (1 + root))
        shrunk = w / root[:, None] / (1.0 + root)[:, None]
        across = np.einsum("nj,nji->ni", w, result)
        result = result - shrunk[:, :, None] * across[:, None, :]
    return np.asarray(result)


def solve_weighted(matrix: Array, target: Array) -> tuple[Array, Array, int]:
    """Solve least squares by QR with scaled columns.

    Parameters
    ----------
    matrix : ndarray, shape (m, p)
        Whitened.
    target : ndarray, shape (m,)
        Whitened.

    Returns
    -------
    (ndarray, ndarray, int)
        Solution, F with F F^T its covariance, rank; nan where the rank is not full.
    """
    p = matrix.shape[1]
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    q, r = linalg.qr(matrix / scale, mode="economic")
    sizes = linalg.svdvals(r)
    rank = int(np.count_nonzero(sizes > _ROUNDING * sizes[0])) if sizes.size else 0
    if rank < p:
        return np.full(p, np.nan), np.full((p, p), np.nan), rank
    inverse = linalg.solve_triangular(r, np.eye(p)) / scale[:, None]
    return inverse @ (q.T @ target), inverse, rank


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
        v = covariances(task.sensor, task.frames.readings, self.signal(ranges, task.frames))
        sd = np.sqrt(np.einsum("nii->ni", v))
        slopes = []
        for k in (0, 1):
            ends = []
            for sign in (1.0, -1.0):
                readings = task.frames.readings.copy()
                readings[:, k] += sign * _STEP * sd[:, k]
                frames = dataclasses.replace(task.frames, readings=readings)
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


def refuse_at_rest(fit: LinearFit, single: TechniqueResult, unknowns: tuple[str, ...]) -> None:
    """Refuse where the ranges differ by no more than their own noise.

    They are regressed on: where their differences are noise, what follows from them is noise too,
    and surer of itself the more frames there are. Of a still object `_STILL` is exceeded in at
    most 1e-3 of sets of four frames or more.

    Parameters
    ----------
    fit : LinearFit
        The fit.
    single : TechniqueResult
        Ranges of single frames, of which the fit has chosen.
    unknowns : tuple of str
        What is fitted.

    Raises
    ------
    RefusedError
        There, with the remedy; never for one unknown, which one range tells.
    """
    if len(unknowns) < 2:
        return
    r = fit.ranges[fit.used]
    roots, sds = single.roots_m[fit.used], single.roots_sd_m[fit.used]
    chosen = np.nanargmin(np.abs(roots - r[:, None]), axis=1)
    own = float(np.nanmedian(sds[np.arange(r.size), chosen] / r)) ** 2
    between = float(np.var(np.log(r)))
    if not between > _STILL * own:
        raise RefusedError(
            "the object hardly moves: the ranges of single frames differ by "
            f"{math.sqrt(between):.2g} of themselves and are uncertain by {math.sqrt(own):.2g}; "
            f"{listed(list(unknowns))} need distinct ranges; move the object nearer and farther, "
            f"or state {'one' if len(unknowns) == 2 else len(unknowns) - 1} of them as known"
        )
