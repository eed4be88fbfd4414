"""How a fit follows what its model may be wrong by, by linear response at its optimum.

A fit takes its model for exact: readings that are off by E a, a standard normal, move its optimum
by J^+ E a, J the derivatives along all that is unknown, ranges included. That is the model's part
of its error budget. What the errors can take up of the residuals is no misfit (docs/model.md,
fit-response).
"""

import dataclasses
import functools

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.arguments import CROSSTALK, SLOTS
from inference.fits.likelihood.information import residuals_and_information
from inference.fits.likelihood.linearisation import whitened_slopes
from inference.fits.likelihood.problem import FitProblem
from inference.frame.delayed import delayed
from inference.frame.sensitivity import Value
from inference.identifiability.elimination import eliminate
from inference.identifiability.information import Information
from simulator.discrepancy import NEGLECTED, discrepancy_basis

__all__ = ["Response", "errors_of_readings", "response_of", "share_left", "unexplained"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class Response:
    """What errors of the model do at given coordinates and ranges.

    Attributes
    ----------
    facts : Information
        What the readings tell if the model is exact.
    residual : ndarray, shape (n, 2)
        Whitened.
    errors : ndarray, shape (n, 2, k)
        Whitened derivatives of the readings along independent standard normal errors, across the
        direction in which the frame's range moves them.
    jacobian : ndarray, shape (n, 2, d)
        The same along the coordinates.
    across : ndarray, shape (m, k + 1)
        Along the errors, and the residuals, as the rows of ``facts.jacobian``.
    along : ndarray, shape (n, k)
        d log r along them at given coordinates; nan without an object.
    free : ndarray of bool, shape (d,)
        Coordinates that no bound holds.
    share : float
        From `share_left`.
    """

    facts: Information
    residual: Array
    errors: Array
    jacobian: Array
    across: Array
    along: Array
    free: NDArray[np.bool_] = dataclasses.field(default_factory=lambda: np.zeros(0, np.bool_))
    share: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether the model has no errors."""
        return bool(self.errors.shape[2] == 0)

    @functools.cached_property
    def of_x(self) -> Array:
        """Change of the coordinates of the optimum with every error, shape (d, k)."""
        if self.exact:
            return np.zeros((len(self.facts.names), 0))
        factor = self.facts.factor
        return np.asarray(factor @ ((self.facts.jacobian @ factor).T @ self.across[:, :-1]))

    def sd_of_log_r(self, of_x: Array) -> Array:
        """Return standard deviations of log r, shape (n,), if x changes by ``of_x``."""
        return np.asarray(np.linalg.norm(self.facts.response @ of_x + self.along, axis=1))

    @functools.cached_property
    def chi_square(self) -> float:
        """Of the residuals, less what errors of the model take up."""
        whole = float(np.einsum("ni,ni->", self.residual, self.residual))
        if self.exact:
            return whole
        seen, moved = self.across[:, -1], self.facts.jacobian[:, self.free]
        left = unexplained(seen, self.across[:, :-1], moved, self.share)
        return max(whole - float(seen @ seen), 0.0) + left

    def chi_square_of_frames(self, of_x: Array) -> Array:
        """Return the chi-square of each frame, errors that x does not follow allowed for, (n,)."""
        if self.exact:
            return np.asarray(np.einsum("ni,ni->n", self.residual, self.residual))
        # followed to first order: a share of their size may be left besides
        parts = [self.errors - self.jacobian @ of_x, np.sqrt(self.share) * self.errors]
        errors = np.concatenate(parts, axis=2)
        told = np.isfinite(errors).all(axis=(1, 2))
        # by singular values: beside errors of 1e8 the noise's covariance of 1 would be lost
        u, s, _ = np.linalg.svd(np.where(told[:, None, None], errors, 0.0), full_matrices=False)
        left = np.einsum("nij,ni->nj", u, self.residual) / np.hypot(1.0, s)
        return np.where(told, np.einsum("nj,nj->n", left, left), np.nan)

    def taken_of_frames(self, of_x: Array) -> Array:
        """Return what errors of the model take off the chi-square of each frame, shape (n,)."""
        whole = np.einsum("ni,ni->n", self.residual, self.residual)
        return np.asarray(whole - self.chi_square_of_frames(of_x))


def unexplained(residual: Array, errors: Array, moved: Array, share: float) -> float:
    """Return the sum of squares that errors of the model do not take up.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        Of unit variance.
    errors : ndarray, shape (m, k)
        Its derivatives along independent standard normal errors.
    moved : ndarray, shape (m, d)
        Along all that the fit is free to follow with.
    share : float
        From `share_left`.
    """
    m, count = errors.shape
    moved = moved / np.maximum(np.linalg.norm(moved, axis=0), np.finfo(float).tiny)
    prior = np.eye(count, count + moved.shape[1])
    rows = np.concatenate([np.concatenate([errors, moved], axis=1), prior])
    target = np.append(residual, np.zeros(count))
    left = target - rows @ scipy.linalg.lstsq(rows, target)[0]
    rest = float(left @ left)
    taken = max(float(residual @ residual) - rest, 0.0) / max(m, 1)
    return float(rest / (1.0 + share * taken))


def errors_of_readings(
    problem: FitProblem, light: Array, positions: Array, slopes: Array | None = None
) -> Array:
    """Return how readings change with errors of the model.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    light : ndarray, shape (n, 2)
        The object's part of the readings.
    positions : ndarray, shape (n,)
        log r; nan without an object.
    slopes : ndarray, shape (n, 2), optional
        Derivative of ``light`` along log r: what is asked for is that of the change.

    Returns
    -------
    ndarray, shape (n, 2, k)
        Along independent standard normal errors, in the unit of ``light``.
    """
    present = np.isfinite(positions)
    basis = discrepancy_basis(*problem.parameters.reach_m)
    at = np.where(present, positions, 0.0)
    functions = np.where(present[:, None], basis.values(at), 0.0)
    if slopes is None:
        return _moved(problem, light, positions, functions)
    steep = np.where(present[:, None], basis.slopes(at), 0.0)
    moved = _moved(problem, slopes, positions, functions)
    return moved + _moved(problem, light, positions, steep)


def _moved(problem: FitProblem, light: Array, positions: Array, functions: Array) -> Array:
    """Return light of which flux and effective distance err by functions, shape (n, 2, k)."""
    late = delayed(light, positions, problem.instrument.r0, problem.instrument.wave)
    parts = [problem.error.flux * light, problem.error.range_m * late]
    return np.concatenate([part[:, :, None] * functions[:, None, :] for part in parts], axis=2)


def share_left(problem: FitProblem, positions: Array) -> float:
    """Return the share of what errors take up of a chi-square that may be left besides.

    They are followed to first order, so that what is left of their size is that size again
    (relative, at the nearest range), and by functions that leave out a part of them.
    """
    nearest = float(np.exp(np.nanmin(positions)))
    return float(problem.error.flux**2 + (problem.error.range_m / nearest) ** 2 + NEGLECTED)


def response_of(problem: FitProblem, x: Array, positions: Array) -> Response:
    """Return how a fit follows errors of its model.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    x : ndarray, shape (d,)
        Coordinates of its optimum.
    positions : ndarray, shape (n,)
        log r of every frame; nan without an object.

    Returns
    -------
    Response
    """
    residual, facts = residuals_and_information(problem, x, positions)
    n = positions.size
    error, present = problem.error, np.isfinite(positions)
    if not present.any() or error.flux == error.range_m == 0.0:
        nothing, d = np.empty((len(facts.jacobian), 0)), len(problem)
        return Response(
            facts, residual, np.empty((n, 2, 0)), np.zeros((n, 2, d)), nothing, np.empty((n, 0))
        )
    values, positions = problem.values(x), np.ascontiguousarray(positions)
    by_value, along, whole = np.empty((n, 2, SLOTS)), np.empty((n, 2)), np.empty((n, 2))
    fit = problem.kernel_fit()
    whitened_slopes(by_value, along, whole, values, np.eye(SLOTS), positions, fit)
    # crosstalk moves the readings themselves
    whitener = by_value[:, :, list(CROSSTALK)]
    signal = by_value[:, :, Value.C2] * values[Value.C2]
    light = np.linalg.solve(whitener, signal[:, :, None])[:, :, 0]
    errors = whitener @ errors_of_readings(problem, light, positions)
    both = np.concatenate([errors, residual[:, :, None]], axis=2)
    moves = np.nan_to_num(along)
    length = np.linalg.norm(moves, axis=1, keepdims=True)
    unit = moves / np.where(length > 0, length, 1.0)
    across = np.eye(2) - unit[:, :, None] * unit[:, None, :]
    seen = eliminate((), by_value[:, :, :0], along, both)
    low, high = problem.bounds(x)
    return Response(
        facts,
        residual,
        across @ errors,
        across @ by_value @ problem.chain(x),
        seen.errors,
        -seen.error_response[:, :-1],
        (x > low) & (x < high),
        share_left(problem, positions),
    )
