"""Readings of a model that errs, linearised along unknowns, ranges and errors."""

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.model_error import errors_of_readings, share_left
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.told import Told, told_at, with_column
from inference.frame.sensitivity import Value
from inference.identifiability.elimination import eliminate

__all__ = [
    "Point",
    "columns_of",
    "left_of_frames",
    "linearised",
    "moved_by_errors",
    "point_at",
    "slopes_of_priors",
    "standard",
    "whitened_of",
]

Array = NDArray[np.float64]

_FARTHEST = 30.0  # standard deviations of the priors, beyond which no slope is
_DIFFERENCE = 1e-4


class Point(NamedTuple):
    """Unknowns, ranges and errors, and the readings linearised there; whitened."""

    x: Array
    u: Array
    a: Array
    z: Array
    deviance: float
    residual: Array
    jacobian: Array
    along: Array
    errors: Array
    told: Told | None


def moved_by_errors(problem: FitProblem, x: Array, u: Array, of_x: Array) -> tuple[Array, Array]:
    """Return what errors of the model do to ranges if the unknowns follow them as is given.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x, u : ndarray, shape (d,), (n,)
        Coordinates, and log r.
    of_x : ndarray, shape (d, k)
        Change of the coordinates with every error.

    Returns
    -------
    (ndarray, ndarray), shape (n,)
        Standard deviation of log r, and chi-square of every frame with the errors allowed for.
    """
    residual, jacobian, along, errors, _ = linearised(problem, x, u)
    seen = eliminate(problem.names, jacobian, along, errors)
    model = np.linalg.norm(seen.response @ of_x - seen.error_response, axis=1)
    more = errors - jacobian @ of_x
    return model, left_of_frames(problem, u, residual, along, errors, more)


def columns_of(problem: FitProblem) -> list[int]:
    """Return where the priors have the unknowns."""
    return [problem.parameters.names.index(name) for name in problem.names]


def standard(problem: FitProblem, points: Array) -> Array:
    """Return coordinates as standard normal ones of the priors, or of the law, shape (m, d)."""
    columns = columns_of(problem)
    natural = np.empty_like(points)
    natural[:, columns] = [problem.natural(x) for x in points]
    with np.errstate(all="ignore"):
        z = problem.parameters.standard(natural)
        if problem.mode is not None:
            off = (z - problem.mode.centre).T
            z = scipy.linalg.solve_triangular(
                problem.mode.factor, off, lower=True, check_finite=False
            ).T
        z = z[:, columns]
    return np.clip(np.nan_to_num(z, nan=_FARTHEST), -_FARTHEST, _FARTHEST)


def slopes_of_priors(problem: FitProblem, x: Array) -> Array:
    """Return the derivatives of `standard` along the coordinates, shape (d, d)."""
    around = np.vstack([x, x + _DIFFERENCE * np.eye(x.size)])
    z = standard(problem, around)
    return np.asarray((z[1:] - z[0]).T / _DIFFERENCE)


def linearised(problem: FitProblem, x: Array, u: Array) -> tuple[Array, ...]:
    """Return residuals, derivatives along unknowns, log r and errors, and from readings to noise.

    All but the last in units of the noise.
    """
    n, values = u.size, problem.values(x)
    by_value, along, residual = np.empty((n, 2, SLOTS)), np.empty((n, 2)), np.empty((n, 2))
    fit = problem.kernel_fit()
    whitened_slopes(by_value, along, residual, values, np.eye(SLOTS), np.ascontiguousarray(u), fit)
    # crosstalk moves the readings themselves
    whitener = by_value[:, :, list(CROSSTALK)]
    signal = by_value[:, :, Value.C2] * values[Value.C2]
    light = np.linalg.solve(whitener, signal[:, :, None])[:, :, 0]
    errors = whitener @ errors_of_readings(problem, light, u)
    errors = with_column(problem.known, np.where(np.isnan(errors), 0.0, errors))
    return residual, by_value @ problem.chain(x), along, errors, whitener


def whitened_of(problem: FitProblem, u: Array, errors: Array, parts: Array) -> Array:
    """Divide by the noise and what is left of errors."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = share_left(problem, u) * np.einsum("nik,njk->nij", errors, errors)
    left = np.where(np.isfinite(left).all(axis=(1, 2), keepdims=True), left, 0.0)
    # beside errors of 1e8 the noise's own 1 would be lost
    own = 1.0 + 1e-12 * np.trace(left, axis1=1, axis2=2)
    factor = np.linalg.cholesky(own[:, None, None] * np.eye(2) + left)
    return np.asarray(np.linalg.solve(factor, parts))


def left_of_frames(
    problem: FitProblem, u: Array, residual: Array, along: Array, errors: Array, more: Array
) -> Array:
    """Return chi-squares of frames across their ranges, shape (n,).

    What is left of errors is allowed for, and what ``more``, shape (n, 2, m), moves.
    """
    move = np.where(np.isfinite(along), along, 0.0)
    length = np.linalg.norm(move, axis=1)
    unit = move / np.where(length > 0.0, length, 1.0)[:, None]
    normal = np.where((length > 0.0)[:, None], np.column_stack([-unit[:, 1], unit[:, 0]]), residual)
    size = np.linalg.norm(normal, axis=1)
    normal = normal / np.where(size > 0.0, size, 1.0)[:, None]

    def across(part: Array) -> Array:
        return np.asarray(np.square(np.einsum("ni,nik->nk", normal, part)).sum(axis=1))

    spread = 1.0 + share_left(problem, u) * across(errors) + across(more)
    return np.asarray(across(residual[:, :, None]) / spread)


def point_at(problem: FitProblem, x: Array, u: Array, a: Array, z: Array | None = None) -> Point:
    """Linearise in units of the noise and of what is left of errors; ``z`` is `standard` of x."""
    residual, jacobian, along, errors, _ = linearised(problem, x, u)
    parts = [(residual - errors @ a)[:, :, None], jacobian, along[:, :, None], errors]
    white = whitened_of(problem, u, errors, np.concatenate(parts, axis=2))
    d = x.size
    residual, z = white[:, :, 0], standard(problem, x[None])[0] if z is None else z
    at = white[:, :, 1 : d + 1], white[:, :, d + 1], white[:, :, d + 2 :]
    told = told_at(problem.known, u, a)
    with np.errstate(over="ignore", invalid="ignore"):
        deviance = float(np.square(residual).sum() + a @ a + z @ z)
        if told is not None:
            deviance += float(np.square(told.residual).sum())
        if problem.mode is not None:
            deviance += problem.mode.deviance
        known = math.isfinite(deviance + float(np.abs(at[0]).sum() + np.abs(at[2]).sum()))
    deviance = deviance if known else math.inf
    return Point(x, u, a, z, deviance, residual, *at, told)
