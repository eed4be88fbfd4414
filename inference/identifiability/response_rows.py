"""What readings and priors tell at one point, its ranges eliminated: rows of linear systems."""

import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.sensitivity import whiteners
from inference.identifiability.clock import by_clock
from inference.identifiability.expected_posterior import eliminated, told_rows
from inference.identifiability.experiment import Experiment

__all__ = ["FluxStep", "ResponseRows", "error_triangle", "flux_step"]

Array = NDArray[np.float64]


class _Derivatives(NamedTuple):
    """Whitened, along the unknowns, the errors and log r; and rows of the priors."""

    jacobian: Array
    by_error: Array
    along: Array
    prior: Array


@dataclasses.dataclass(frozen=True, eq=False)
class ResponseRows:
    """What readings and priors tell at one point, its ranges eliminated on demand.

    Attributes
    ----------
    experiment : Experiment
        The point.
    range_error : float
        Where positive, the errors are those of the effective distance, of this standard deviation
        [m], and the flux's, if there are any, are unknowns behind z.
    followed : int
        How many of the experiment's errors, the first, are unknowns behind z.
    """

    experiment: Experiment
    range_error: float = 0.0
    followed: int = 0

    @functools.cached_property
    def _all(self) -> _Derivatives:
        e = self.experiment
        jacobian, along, extra = told_rows(e)
        d = len(e.parameters)
        present = np.isfinite(e.log_r)
        # a range that the readings do not tell stays within its prior's support
        low, high = e.range_prior.low, e.range_prior.high
        room = math.log(high / low) if low > 0 else math.inf
        if room > 0:
            limit = math.sqrt(12.0) / room
            wide = present & (np.abs(along[:, 2]) < limit)
            if e.common_range:
                wide &= np.cumsum(present) == 1
            along[wide, 2] = limit
        if self.range_error > 0:
            late = self._by_range_error(along.shape[1])
            return _Derivatives(jacobian, late, along, np.concatenate(extra))
        d += self.followed
        prior = np.concatenate([np.eye(d), *(rows[:, :d] for rows in extra[1:])])
        return _Derivatives(jacobian[:, :, :d], jacobian[:, :, d:], along, prior)

    def _by_range_error(self, m: int) -> Array:
        """Return whitened derivatives along errors of the distance that an object seems to have."""
        e = self.experiment
        late = by_clock(
            e.sensor, e.readings.signal, e.log_r, e.parameters.reach_m, self.range_error
        )
        result = np.zeros((e.log_r.size, m, late.shape[2]))
        result[:, :2] = np.einsum("nij,njk->nik", whiteners(e.sensor, e.readings), late)
        return result

    @property
    def by_error(self) -> Array:
        """Whitened derivatives along the errors, shape (n, m, k); m as of `told_rows`."""
        return self._all.by_error

    @property
    def jacobian(self) -> Array:
        """Whitened derivatives along the unknowns, shape (n, m, d)."""
        return self._all.jacobian

    @property
    def along(self) -> Array:
        """Whitened derivatives along log r, shape (n, m)."""
        return self._all.along

    def follow(self, errors: Array, of_prior: Array | None = None) -> tuple[Array, Array, Array]:
        """Return how z and log r follow errors of the readings, and what is left of these.

        Parameters
        ----------
        errors : ndarray, shape (n, m, k)
            Of two whitened readings, of the prior of log r, and of what is known beside them.
        of_prior : ndarray, shape (d, k), optional
            Of the prior of z; left out: none.

        Returns
        -------
        (ndarray, ndarray, ndarray)
            Shapes (d, k), (n, k), and (rows, k) across all that the model can follow.
        """
        jacobian, _, along, prior = self._all
        d, k = jacobian.shape[2], errors.shape[2]
        both = np.concatenate([jacobian, errors], axis=2)
        across, response, _ = eliminated(self.experiment, both, along)
        rows = across.reshape(-1, d + k)
        seen = np.concatenate([rows[:, d:], np.zeros((len(prior), k))])
        if of_prior is not None:
            seen[len(rows) : len(rows) + d] = of_prior
        change = np.zeros((d, k))
        if d > 0:
            own = np.concatenate([rows[:, :d], prior])
            factor, triangle = scipy.linalg.qr(own, mode="economic", check_finite=False)
            told = factor.T @ seen
            change = scipy.linalg.solve_triangular(triangle, told)
            seen = seen - factor @ told
        # `response` leaves the readings where they are: an error in them moves the range against it
        return change, response[:, :d] @ change - response[:, d:], seen

    def residual(self, seen: Array) -> Array:
        """Return what readings and priors of the ranges are off, shape (n, m).

        Parameters
        ----------
        seen : ndarray, shape (n, 2 or 4)
            The readings, and range and displacement [m] where they are known beside them.
        """
        e, law = self.experiment, self.experiment.range_prior
        present, along = np.isfinite(e.log_r), self.along
        u = np.where(present, e.log_r, 0.0)
        off = np.zeros(along.shape)
        whitener = whiteners(e.sensor, e.readings)
        off[:, :2] = np.einsum("nij,nj->ni", whitener, seen[:, :2] - e.readings.mean)
        pull = np.exp(u) * (law.mean - np.exp(u)) * law.inverse_sd**2
        pull += (law.log_mean - u) * law.log_inverse_sd**2
        np.divide(pull, along[:, 2], out=off[:, 2], where=along[:, 2] > 0)
        if e.rates is not None:
            off[:, 3:] = np.where(e.rates > 0, (seen[:, 2:] - e.told) * e.rates, 0.0)
        return off

    def spreads(self) -> tuple[Array, Array, Array, Array]:
        """Return ``own``, ``alone``, ``sd`` and ``shared`` of `ModelResponse`."""
        jacobian, _, along, prior = self._all
        across, response, variance = eliminated(self.experiment, jacobian, along)
        present = np.isfinite(self.experiment.log_r)
        own = np.where(present, np.sqrt(np.where(present, variance, 0.0)), 0.0)
        d = jacobian.shape[2]
        if d == 0:
            return own, np.zeros(0), np.zeros(0), np.zeros(own.size)
        rows = np.concatenate([across.reshape(-1, d), prior])
        factor = scipy.linalg.solve_triangular(scipy.linalg.qr(rows, mode="r")[0][:d], np.eye(d))
        alone, sd = 1.0 / np.linalg.norm(rows, axis=0), np.linalg.norm(factor, axis=1)
        return own, alone, sd, np.linalg.norm(response @ factor, axis=1)


@dataclasses.dataclass(frozen=True, eq=False)
class FluxStep:
    """A Gauss-Newton step with the flux's error: how all follow it, and how they follow readings.

    Attributes
    ----------
    by_error : (ndarray, ndarray)
        Change of z and of log r with the error's coefficients, shape (d, k) and (n, k), that
        leaves the readings where they are as far as the model can.
    by_readings : (ndarray, ndarray)
        Change towards the readings, shape (d,) and (n,).
    left, followed : ndarray, shape (rows,)
        What readings and priors are off, divided into what is left of it then and the rest.
    across : ndarray, shape (rows, k)
        What nothing but the error can follow.
    triangle : ndarray, shape (k, k)
        Of what is known of the error: its precision is I + across^T across.
    """

    by_error: tuple[Array, Array]
    by_readings: tuple[Array, Array]
    left: Array
    followed: Array
    across: Array
    triangle: Array

    def coefficients(self, before: Array) -> Array:
        """Return by how much the readings move coefficients, whose prior is standard normal."""
        told = self.across.T @ self.left - before
        told = scipy.linalg.solve_triangular(self.triangle, told, trans="T")
        return np.asarray(scipy.linalg.solve_triangular(self.triangle, told))


def error_triangle(across: Array) -> Array:
    """Return R with R^T R = I + across^T across, the precision of the error's coefficients.

    Parameters
    ----------
    across : ndarray, shape (rows, k)
        What nothing but the error can follow.

    Returns
    -------
    ndarray, shape (k, k)
    """
    k = across.shape[1]
    return np.asarray(scipy.linalg.qr(np.concatenate([across, np.eye(k)]), mode="r")[0][:k])


def flux_step(rows: ResponseRows, off: Array, of_prior: Array) -> FluxStep:
    """Return the step from what readings, shape (n, m), and priors of z, shape (d,), are off."""
    k = rows.by_error.shape[2]
    prior = np.zeros((of_prior.size, k + 1))
    prior[:, k] = of_prior
    both = np.concatenate([rows.by_error, off[:, :, None]], axis=2)
    change, moved, left = rows.follow(both, prior)
    triangle = error_triangle(left[:, :k])
    whole = np.zeros(len(left))
    whole[: off.size] = off.ravel()
    whole[off.size : off.size + of_prior.size] = of_prior
    return FluxStep(
        (-change[:, :k], -moved[:, :k]),
        (change[:, k], moved[:, k]),
        left[:, k],
        whole - left[:, k],
        left[:, :k],
        triangle,
    )
