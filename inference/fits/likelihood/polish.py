"""The last stretch to an optimum: Newton's method with the exact curvature of the profile.

Levenberg-Marquardt takes the curvature from first derivatives alone. Where a frame's readings
barely move with its range (near a fold, or a weak object before a bright background), that misses
most of it, and the steps zigzag along flat valleys. Here the Hessian comes from differences of
exact gradients along directions in which the first-order information is the unit matrix.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.deviance import POSITION
from inference.fits.likelihood.erring_point import standard_and_slopes
from inference.fits.likelihood.linearisation import rows_of
from inference.fits.likelihood.problem import FitProblem
from inference.fits.likelihood.profile_slopes import profile_slopes

__all__ = ["polish"]

Array = NDArray[np.float64]

_STEPS = 40
_RADIUS = 3.0  # of the trust region at first, in directions of unit information
_DIFFERENCE = 0.05  # standard deviations
_LONGEST = 1.0  # change of a logarithm along one unit of a direction
_ENOUGH = 5e-5  # half deviance that a whole step would still gain


class _Profile:
    """Half the deviance as a function of the coordinates, and its gradient."""

    def __init__(self, problem: FitProblem) -> None:
        self.problem = problem
        self.fit = problem.kernel_fit()
        n, d = problem.frames.shape[0], len(problem)
        self.place = problem.place(np.empty(d))
        self.matrix = np.empty((rows_of(n, problem.instrument), d + 1))

    @property
    def jacobian(self) -> Array:
        """Rows of the last point that was asked for, shape (m, d)."""
        return np.asarray(self.matrix[:, :-1])

    def __call__(self, x: Array) -> tuple[float, Array]:
        self.place.x[:] = x
        value = profile_slopes(self.matrix, self.place, self.fit)
        return 0.5 * value, -(self.matrix[:, :-1].T @ self.matrix[:, -1])


class _WithPriors(_Profile):
    """The same with what the priors say of the unknowns."""

    slopes: Array

    @property
    def jacobian(self) -> Array:
        return np.vstack([super().jacobian, self.slopes])

    def __call__(self, x: Array) -> tuple[float, Array]:
        value, gradient = super().__call__(x)
        z, self.slopes = standard_and_slopes(self.problem, x)
        return value + 0.5 * float(z @ z), gradient + self.slopes.T @ z


def _directions(jacobian: Array, problem: FitProblem, free: NDArray[np.bool_]) -> Array:
    """Columns along which the first-order information is the unit matrix or less, (d, free)."""
    j = jacobian[:, free]
    scale = np.linalg.norm(j, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    triangle = scipy.linalg.qr(j / scale, mode="r")[0][: j.shape[1]]
    _, sizes, right = scipy.linalg.svd(triangle)
    sizes = np.concatenate([sizes, np.zeros(j.shape[1] - sizes.size)])
    columns = (right.T / np.maximum(sizes, 1e-12)) / scale[:, None]
    logarithms = problem.logarithms[free]
    if logarithms.any():
        longest = np.abs(columns[logarithms]).max(axis=0)
        columns = columns / np.maximum(longest / _LONGEST, 1.0)
    out = np.zeros((jacobian.shape[1], j.shape[1]))
    out[free] = columns
    return out


def _length(vector: Array) -> float:
    """Return what `numpy.linalg.norm` does, in a sixth of the time."""
    return math.sqrt(vector.dot(vector))


def _step(gradient: Array, hessian: Array, radius: float) -> tuple[Array, float]:
    """Minimise a quadratic in a ball; the step and its predicted decrease."""
    values, vectors = scipy.linalg.eigh(hessian)
    along = vectors.T @ gradient

    def at(shift: float) -> Array:
        return np.asarray(-along / np.maximum(values + shift, 1e-14))

    shift = max(0.0, 1e-8 - float(values[0]))
    if _length(at(shift)) > radius:
        low, high = shift, shift + _length(along) / radius
        for _ in range(60):
            middle = 0.5 * (low + high)
            if _length(at(middle)) > radius:
                low = middle
            else:
                high = middle
        shift = high
    s = at(shift)
    return vectors @ s, float(-(along @ s) - 0.5 * s @ (values * s))


def polish(problem: FitProblem, x: Array) -> tuple[Array, float, float, Array]:
    """Climb to the top by Newton steps in a trust region.

    Parameters
    ----------
    x : ndarray, shape (d,)
        A point on the way to an optimum.

    Returns
    -------
    (ndarray, float, float, ndarray)
        Coordinates, deviance, deviance that a whole step would still gain, and best log ranges.
    """
    profile = _WithPriors(problem) if problem.priors else _Profile(problem)
    x = x.copy()
    value, gradient = profile(x)
    radius, predicted = _RADIUS, np.inf
    for _ in range(_STEPS):
        if not (np.isfinite(value) and np.isfinite(gradient).all()):
            break
        low, high = problem.bounds(x)
        free = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
        if not free.any():
            predicted = 0.0
            break
        basis = _directions(profile.jacobian, problem, free)
        columns = []
        for k in range(basis.shape[1]):
            trial = np.clip(x + _DIFFERENCE * basis[:, k], low, high)
            change = trial - x
            if np.linalg.norm(change) < 0.5 * _DIFFERENCE * np.linalg.norm(basis[:, k]):
                change = np.clip(x - _DIFFERENCE * basis[:, k], low, high) - x
            other = profile(x + change)[1]
            along = _DIFFERENCE * np.sign(change @ basis[:, k])
            # where the bounds leave no step either way this is nan, and the walk ends below
            with np.errstate(invalid="ignore", divide="ignore"):
                columns.append(basis.T @ (other - gradient) / along)
        hessian = np.array(columns)
        if not np.isfinite(hessian).all():
            break
        hessian = 0.5 * (hessian + hessian.T)
        moved = False
        for _ in range(8):
            step, predicted = _step(basis.T @ gradient, hessian, radius)
            if predicted < _ENOUGH and radius > 0.5:
                break
            trial = np.clip(x + basis @ step, low, high)
            low_there, high_there = problem.bounds(trial)
            trial = np.clip(trial, low_there, high_there)
            trial_value, trial_gradient = profile(trial)
            if trial_value < value:
                moved = True
                gained = value - trial_value
                x, value, gradient = trial, trial_value, trial_gradient
                if gained > 0.7 * predicted:
                    radius = min(2.0 * radius, 1e3)
                break
            radius = 0.25 * min(radius, float(np.linalg.norm(step)))
        if not moved:
            # what a step of the first length would still gain, not what the last short one would
            predicted = _step(basis.T @ gradient, hessian, _RADIUS)[1]
            break
        if gained < 0.25 * predicted:
            radius *= 0.5
    value, _ = profile(x)
    return x, 2.0 * value, 2.0 * predicted, profile.place.best[0, :, POSITION].copy()
