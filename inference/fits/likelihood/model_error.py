"""What smooth errors of the model do to the readings of a fit (docs/model.md, fit-response)."""

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.fits.likelihood.problem import FitProblem
from inference.frame.delayed import delayed
from inference.frame.shadow_error import ShadowError, shadow_basis, shadow_error
from simulator.discrepancy import NEGLECTED, discrepancy_basis

__all__ = [
    "ErringFlux",
    "ErringLight",
    "erring_flux",
    "errors_of_light",
    "left_at_places",
    "number_of_errors",
    "own_share_left",
    "shadow_of",
    "share_left",
    "unexplained",
]

Array = NDArray[np.float64]

_FARTHEST = 3.29  # standard deviations of an error, beyond which it is one in a thousand


def unexplained(residual: Array, errors: Array, share: float, light: Array) -> float:
    """Return the sum of squares that errors of the model do not take up.

    What following an error leaves grows with that error, and is noise of the row that it moves
    (docs/model.md, linear-misfit). An error farther off than its law lets it be excuses no more.

    Parameters
    ----------
    residual : ndarray, shape (m,)
        Of unit variance.
    errors : ndarray, shape (m, k)
        Its derivatives along independent standard normal errors.
    share : float
        From `share_left`.
    light : ndarray, shape (m,)
        The object's light in each row. An error leaves its own square of it, which the fit may
        follow less than the error.

    Returns
    -------
    float
        With what errors have to be for it.
    """
    size = np.square(errors).sum(axis=1)
    a = _followed(residual, errors)[0]
    left = share * np.clip(np.square(errors @ a), size, _FARTHEST**2 * size)
    root = np.sqrt(1.0 + left + np.square(share * light))
    return _followed(residual / root, errors / root[:, None])[1]


def _followed(residual: Array, errors: Array) -> tuple[Array, float]:
    """Return the best errors, and the sum of their squares and of what they leave."""
    count = errors.shape[1]
    rows = np.concatenate([errors, np.eye(count)])
    target = np.append(residual, np.zeros(count))
    a = np.asarray(scipy.linalg.lstsq(rows, target)[0])
    left = target - rows @ a
    return a, float(left @ left)


class ErringFlux(NamedTuple):
    """Functions of log r by which an object's flux and effective distance err, at given ranges.

    Attributes
    ----------
    problem : FitProblem
        The problem.
    positions : ndarray, shape (n,)
        log r; nan without an object.
    values, slopes : ndarray, shape (n, k)
        Of k functions, and of their slopes along log r; zero without an object.
    """

    problem: FitProblem
    positions: Array
    values: Array
    slopes: Array

    def of_light(self, light: Array) -> Array:
        """Return how readings change with independent standard normal errors, (n, 2, 2 k)."""
        return _moved(self.problem, light, self.positions, self.values)

    def slopes_of_light(self, light: Array, slopes: Array) -> Array:
        """Return the derivatives of that along log r; ``slopes`` are those of the light."""
        moved = _moved(self.problem, slopes, self.positions, self.values)
        return moved + _moved(self.problem, light, self.positions, self.slopes)

    def by(self, a: Array) -> "ErringLight":
        """Return what errors of given sizes do, shape (2 k,)."""
        of_flux, of_range = np.split(a, 2)
        values = np.column_stack([self.values @ of_flux, self.values @ of_range])
        slopes = np.column_stack([self.slopes @ of_flux, self.slopes @ of_range])
        return ErringLight(self.problem, self.positions, values, slopes)


class ErringLight(NamedTuple):
    """What given errors do to light; arrays have a column each for flux and effective distance."""

    problem: FitProblem
    positions: Array
    values: Array
    slopes: Array

    def change(self, light: Array) -> Array:
        """Return the change of light, shape (n, 2)."""
        return self._moved(light, self.values)

    def change_of_slopes(self, light: Array, slopes: Array) -> Array:
        """Return the change of its slopes along log r, shape (n, 2)."""
        return self._moved(slopes, self.values) + self._moved(light, self.slopes)

    def _moved(self, light: Array, by: Array) -> Array:
        at, error = self.problem.instrument, self.problem.error
        late = delayed(light, self.positions, at.r0, at.wave)
        return np.asarray(error.flux * by[:, :1] * light + error.range_m * by[:, 1:] * late)


def erring_flux(problem: FitProblem, positions: Array) -> ErringFlux:
    """Return the functions by which an object errs; none where it does not.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    positions : ndarray, shape (n,)
        log r; nan without an object.
    """
    if not problem.object_errs:
        return ErringFlux(problem, positions, *np.zeros((2, positions.size, 0)))
    present = np.isfinite(positions)
    basis = discrepancy_basis(*problem.parameters.reach_m)
    at = np.where(present, positions, 0.0)
    values = np.where(present[:, None], basis.values(at), 0.0)
    slopes = np.where(present[:, None], basis.slopes(at), 0.0)
    return ErringFlux(problem, positions, values, slopes)


def _moved(problem: FitProblem, light: Array, positions: Array, functions: Array) -> Array:
    """Return light of which flux and effective distance err by functions, shape (n, 2, k)."""
    late = delayed(light, positions, problem.instrument.r0, problem.instrument.wave)
    parts = [problem.error.flux * light, problem.error.range_m * late]
    return np.concatenate([part[:, :, None] * functions[:, None, :] for part in parts], axis=2)


def shadow_of(problem: FitProblem, values: Array, positions: Array) -> ShadowError | None:
    """Return the background as errors of its shadow act on it; None where there are none.

    Parameters
    ----------
    problem : FitProblem
        The problem.
    values : ndarray, shape (SLOTS,)
        Physical values, readings in the problem's unit.
    positions : ndarray, shape (n,)
        log r; nan without an object.
    """
    if not problem.shadow_errs:
        return None
    at, reach = problem.instrument, problem.parameters.reach_m
    return shadow_error(values, positions, problem.frames[:, 2], at, reach, problem.error.shadow)


def number_of_errors(problem: FitProblem) -> int:
    """Return how many errors a fit has."""
    return errors_of_light(problem).size


def errors_of_light(problem: FitProblem) -> NDArray[np.bool_]:
    """Return of every error whether it is one of the object's light, shape (k,)."""
    reach = problem.parameters.reach_m
    own = 2 * discrepancy_basis(*reach).size if problem.object_errs else 0
    of_shadow = 2 * shadow_basis(*reach).size if problem.shadow_errs else 0
    at_places = 0 if problem.places is None else 2 * problem.places.number
    offset = problem.known is not None and problem.known.offset_sd > 0.0
    return np.repeat([True, False, True, False], [own, of_shadow, at_places, int(offset)])


def share_left(problem: FitProblem, positions: Array) -> float:
    """Return the share of what errors take up of a chi-square that may be left besides.

    They are followed to first order, so that what is left of their size is that size again
    (relative, at the nearest range), and by functions that leave out a part of them.
    """
    nearest = float(np.exp(np.nanmin(positions)))
    return float(problem.error.flux**2 + (problem.error.range_m / nearest) ** 2 + NEGLECTED)


def own_share_left(problem: FitProblem, positions: Array) -> Array:
    """Return the same of every frame, (n,): 0 where it is `left_at_places`, not a frame's own."""
    share = share_left(problem, positions)
    if problem.places is None:
        return np.full(positions.size, share)
    return np.where(problem.places.of_frame < 0, share, 0.0)


def left_at_places(problem: FitProblem, light: Array, positions: Array) -> Array:
    """Return what errors leave that frames at one place share, by place.

    Parameters
    ----------
    problem, light, positions
        The object's part of the readings, shape (n, 2); log r, shape (n,).

    Returns
    -------
    ndarray, shape (n, 2, 2 places)
        Along independent standard normal errors, of the flux at all places and then of the range.
    """
    if problem.places is None:
        return np.empty((positions.size, 2, 0))
    here = problem.places.of_frame[:, None] == np.arange(problem.places.number)
    here &= np.isfinite(positions)[:, None]
    return _moved(problem, light, positions, np.sqrt(share_left(problem, positions)) * here)
