"""How a posterior that takes its model for exact moves with the model's errors, linearised.

Readings of an object whose flux differs by a smooth curve, delta = sum a_k phi_k(log r), move the
posterior's mode by a Gauss-Newton step: the ranges of all frames are eliminated (along what they
draw their readings follow delta freely), the parameters are held by their standard normal priors,
and an orthogonal decomposition of the rows gives J^+ E, the change of z and of every log r with
a_k. What the step leaves of E across all that the model can follow is what the readings tell of a:
with it the prior of a, standard normal, becomes its posterior. A draw of the exact model's
posterior minus J^+ E a, a drawn from that, is a draw of the posterior with the error integrated
out, as far as the model is linear (docs/model.md, model-response).

An error of the effective distance moves a frame's readings along the curve that its range draws:
the range follows it, as far as the readings tell the range at all.
"""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from inference.frame.sensitivity import sensitivity, whiteners
from inference.identifiability.expected_posterior import rows_of, without_ranges
from inference.identifiability.experiment import Experiment
from simulator.discrepancy import discrepancy_basis

__all__ = ["ModelResponse", "curvature_of_response", "model_response"]

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, eq=False)
class FluxError:
    """What the readings tell of the error of the flux.

    Attributes
    ----------
    mean : ndarray, shape (k,)
        Of its coefficients, whose prior is standard normal.
    spread : ndarray, shape (k, k)
        Factor F of their covariance F F^T.
    """

    mean: Array
    spread: Array


@dataclasses.dataclass(frozen=True, eq=False)
class ModelResponse:
    """Response at one parameter vector and one range of every frame.

    Attributes
    ----------
    parameters : ndarray, shape (d, k)
        Change of z with each of k independent standard normal variates: the flux's error as far as
        the readings leave it open.
    log_r : ndarray, shape (n, k)
        Change of log r with them; zero for a frame without object.
    shift : (ndarray, ndarray)
        Change of z and of log r with what the readings tell of the error, shape (d,) and (n,).
    error : FluxError
        What is known of the error.
    told : ndarray, shape (n,)
        Share of the information on log r that is the readings', not its prior's.
    own : ndarray, shape (n,)
        Standard deviation of log r with z known; zero for a frame without object.
    alone : ndarray, shape (d,)
        Standard deviation of every z with all others known.
    sd : ndarray, shape (d,)
        Standard deviation of every z, were there no error of the model.
    shared : ndarray, shape (n,)
        That of log r that comes from z.
    """

    parameters: Array
    log_r: Array
    shift: tuple[Array, Array]
    error: FluxError
    told: Array
    own: Array
    alone: Array
    sd: Array
    shared: Array


@dataclasses.dataclass(frozen=True, eq=False)
class _Rows:
    """What readings and priors tell at one point, its ranges eliminated on demand."""

    experiment: Experiment

    @functools.cached_property
    def _all(self) -> tuple[Array, Array, Array, Array]:
        """Derivatives along z, the flux's errors and log r, and rows of z's prior."""
        e = self.experiment
        jacobian, along, extra = rows_of(e)
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
        prior = np.concatenate([np.eye(d), *(rows[:, :d] for rows in extra[1:])])
        return jacobian[:, :, :d], jacobian[:, :, d:], along, prior

    @property
    def by_error(self) -> Array:
        """Whitened derivatives along the flux's errors, shape (n, 3, k)."""
        return self._all[1]

    @property
    def jacobian(self) -> Array:
        """Whitened derivatives along z, shape (n, 3, d)."""
        return self._all[0]

    @property
    def along(self) -> Array:
        """Whitened derivatives along log r, shape (n, 3)."""
        return self._all[2]

    def follow(self, errors: Array, of_prior: Array | None = None) -> tuple[Array, Array, Array]:
        """Return how z and log r follow errors of the readings, and what is left of these.

        Parameters
        ----------
        errors : ndarray, shape (n, 3, k)
            Of two whitened readings, and of the prior of log r.
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
        across, response, _ = without_ranges(self.experiment, both, along)
        rows = across.reshape(-1, d + k)
        seen = np.concatenate([rows[:, d:], np.zeros((len(prior), k))])
        if of_prior is not None:
            seen[len(rows) : len(rows) + d] = of_prior
        change = np.zeros((d, k))
        if d > 0:
            own = np.concatenate([rows[:, :d], prior])
            factor, triangle = linalg.qr(own, mode="economic", check_finite=False)
            told = factor.T @ seen
            change = linalg.solve_triangular(triangle, told)
            seen = seen - factor @ told
        # `response` leaves the readings where they are: an error in them moves the range against it
        return change, response[:, :d] @ change - response[:, d:], seen

    def residual(self, seen: Array) -> Array:
        """Return what readings, shape (n, 2), and priors of the ranges are off, (n, 3, 1)."""
        e, law = self.experiment, self.experiment.range_prior
        present, along = np.isfinite(e.log_r), self._all[2]
        u = np.where(present, e.log_r, 0.0)
        off = np.zeros((u.size, 3, 1))
        whitener = whiteners(e.sensor, e.readings)
        off[:, :2, 0] = np.einsum("nij,nj->ni", whitener, seen - e.readings.mean)
        pull = np.exp(u) * (law.mean - np.exp(u)) * law.inverse_sd**2
        pull += (law.log_mean - u) * law.log_inverse_sd**2
        np.divide(pull, along[:, 2], out=off[:, 2, 0], where=along[:, 2] > 0)
        return off

    def spreads(self) -> tuple[Array, Array, Array, Array]:
        """Return ``own``, ``alone``, ``sd`` and ``shared`` of `ModelResponse`."""
        jacobian, _, along, prior = self._all
        across, response, variance = without_ranges(self.experiment, jacobian, along)
        present = np.isfinite(self.experiment.log_r)
        own = np.where(present, np.sqrt(np.where(present, variance, 0.0)), 0.0)
        d = jacobian.shape[2]
        if d == 0:
            return own, np.zeros(0), np.zeros(0), np.zeros(own.size)
        rows = np.concatenate([across.reshape(-1, d), prior])
        factor = linalg.solve_triangular(linalg.qr(rows, mode="r")[0][:d], np.eye(d))
        alone, sd = 1.0 / np.linalg.norm(rows, axis=0), np.linalg.norm(factor, axis=1)
        return own, alone, sd, np.linalg.norm(response @ factor, axis=1)


def _solved(triangle: Array, across: Array, off: Array) -> Array:
    """Return the coefficients that readings off the model, shape (rows,), tell."""
    mean = linalg.solve_triangular(triangle, across.T @ off, trans="T")
    return np.asarray(linalg.solve_triangular(triangle, mean))


def model_response(experiment: Experiment, readings: Array) -> ModelResponse:
    """Return the response of a posterior that takes its model for exact.

    Parameters
    ----------
    experiment : Experiment
        A draw with its ranges; its ``discrepancy`` is the size of the flux's error.
    readings : ndarray, shape (n, 2)
        Of the frames.

    Returns
    -------
    ModelResponse
    """
    rows = _Rows(experiment)
    k, d = rows.by_error.shape[2], len(experiment.parameters)
    of_prior = np.zeros((d, k + 1))
    of_prior[:, k] = -experiment.z
    both = np.concatenate([rows.by_error, rows.residual(readings)], axis=2)
    change, moved, left = rows.follow(both, of_prior)
    change, moved, across = change[:, :k], moved[:, :k], left[:, :k]
    # what is known of the error: its precision is I + across^T across, and readings off the model
    # by what nothing else can follow tell its mean
    triangle = linalg.qr(np.concatenate([across, np.eye(k)]), mode="r")[0][:k]
    mean = _solved(triangle, across, left[:, k])
    spread = np.asarray(linalg.solve_triangular(triangle, np.eye(k)))
    along = np.square(rows.along)
    whole = along.sum(axis=1)
    if experiment.common_range:
        told = np.full(whole.size, along[:, :2].sum() / max(whole.sum(), 1e-300))
        told[~np.isfinite(experiment.log_r)] = 0.0
    else:
        told = np.divide(along[:, :2].sum(axis=1), whole, out=np.zeros(whole.size), where=whole > 0)
    error = FluxError(mean, spread)
    shift = -change @ mean, -moved @ mean
    return ModelResponse(-change @ spread, -moved @ spread, shift, error, told, *rows.spreads())


def curvature_of_response(experiment: Experiment, coefficients: Array) -> float:
    """Return how far the linear response misses where one error of the flux leads.

    Parameters
    ----------
    experiment : Experiment
        As for `model_response`.
    coefficients : ndarray, shape (k,)
        Of the error.

    Returns
    -------
    float
        Root mean square over the frames of what the next Gauss-Newton step would still move log r
        by; inf where it leads beyond what numbers hold.
    """
    e, rows = experiment, _Rows(experiment)
    present = np.isfinite(e.log_r)
    change, moved, across = rows.follow(rows.by_error)
    dz, du = -change @ coefficients, np.where(present, -moved @ coefficients, 0.0)
    if e.discrepancy is None or not present.any():
        return 0.0
    basis = discrepancy_basis(*e.parameters.reach_m)
    at = np.where(present, e.log_r + du, basis.first)
    size = np.where(present, e.discrepancy, 0.0)
    curve = (size * (basis.values(at) @ coefficients), size * (basis.slopes(at) @ coefficients))
    with np.errstate(all="ignore"):
        terms = e.parameters.terms((e.z + dz)[None])
        mean = sensitivity(e.sensor, terms, e.log_r + du, e.gain, curve).mean
        off = rows.residual(2.0 * e.readings.mean - mean)
    # to first order the readings stay where they are, but for what across leaves of the error
    linear = rows.by_error @ coefficients + rows.jacobian @ dz + rows.along * du[:, None]
    off[:, :2, 0] += linear[:, :2]
    off[:, 2] = 0.0
    if not np.isfinite(off).all():
        return math.inf
    dz, again, left = rows.follow(off)
    triangle = linalg.qr(np.concatenate([across, np.eye(across.shape[1])]), mode="r")[0]
    again = again[:, 0] - moved @ _solved(triangle[: across.shape[1]], across, left[:, 0])
    return float(np.sqrt(np.mean(np.square(again[present]))))
