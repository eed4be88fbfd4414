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
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.sensitivity import whiteners
from inference.identifiability.experiment import Experiment
from inference.identifiability.response_rows import (
    FluxStep,
    ResponseRows,
    error_triangle,
    flux_step,
)

__all__ = ["FluxTold", "ModelResponse", "common_pull", "curvature_of_response", "model_response"]

Array = NDArray[np.float64]
_STEPS = 10
_SHORTEST = 0.1  # share of a step
_SETTLED = 0.1  # of the deviance, that the last step gained
_FARTHEST = 30.0  # of log r: beyond a factor 1e13 nothing tells a range, and a step would overflow


class _Point(NamedTuple):
    """A place about a draw: change of z and of log r, coefficients of the flux's error."""

    z: Array
    log_r: Array
    error: Array

    def plus(self, way: "_Point", share: float) -> "_Point":
        """Return the place some share of a way further."""
        return _Point(*(here + share * there for here, there in zip(self, way, strict=True)))


@dataclasses.dataclass(frozen=True, eq=False)
class FluxTold:
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
    error : FluxTold
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
    followed : ndarray, shape (rows,)
        What the readings and priors are off the draw, as far as the exact model could follow them:
        the noise of a draw, about the mode.
    """

    parameters: Array
    log_r: Array
    shift: tuple[Array, Array]
    error: FluxTold
    told: Array
    own: Array
    alone: Array
    sd: Array
    shared: Array
    followed: Array


def model_response(
    experiment: Experiment, readings: Array, pull: Array | None = None
) -> ModelResponse:
    """Return the response of a posterior that takes its model for exact.

    Parameters
    ----------
    experiment : Experiment
        A draw with its ranges; its ``discrepancy`` is the size of the flux's error, its ``shadow``
        that of the shadow's.
    readings : ndarray, shape (n, 2 or 4)
        Of the frames, and range and displacement [m] where they are known beside them.
    pull : ndarray, shape (rows,), optional
        What is ``followed`` by all draws, as `common_pull` finds it. Then steps are repeated until
        they settle, each with its own derivatives; left out: the first is all.

    Returns
    -------
    ModelResponse
    """
    rows = ResponseRows(experiment)
    step = flux_step(rows, rows.residual(readings), -experiment.z)
    k = step.across.shape[1]
    mean = step.coefficients(np.zeros(k))
    point = _Point(step.by_error[0] @ mean, step.by_error[1] @ mean, mean)
    followed = step.followed
    if pull is not None:
        point, step = _settled(rows, step, point, pull)
    spread = np.asarray(scipy.linalg.solve_triangular(step.triangle, np.eye(k)))
    along = np.square(rows.along)
    whole = along.sum(axis=1)
    if experiment.common_range:
        told = np.full(whole.size, along[:, :2].sum() / max(whole.sum(), 1e-300))
        told[~np.isfinite(experiment.log_r)] = 0.0
    else:
        told = np.divide(along[:, :2].sum(axis=1), whole, out=np.zeros(whole.size), where=whole > 0)
    error = FluxTold(point.error, spread)
    follow = step.by_error[0] @ spread, step.by_error[1] @ spread
    return ModelResponse(*follow, (point.z, point.log_r), error, told, *rows.spreads(), followed)


def common_pull(responses: Sequence[ModelResponse]) -> Array:
    """Return what all draws could follow and do not, shape (rows,); zero where that is little.

    Draws lie about the mode of readings that the exact model can make, but for what volume adds,
    one squared standard deviation an unknown at most. Readings that it cannot make are not met
    best where its mode is: noise that grows with the signal, for one, pulls it to more noise.
    """
    mean = np.mean([each.followed for each in responses], axis=0)
    size = float(np.square(mean).sum())
    unknowns = len(responses[0].parameters)
    return np.asarray(mean * (1.0 - unknowns / size if size > unknowns else 0.0))


def _moved(experiment: Experiment, by: _Point) -> Experiment:
    z, log_r = experiment.z + by.z, experiment.log_r + by.log_r
    return dataclasses.replace(experiment, z=z, log_r=log_r, error=by.error)


def _means(experiment: Experiment) -> Array:
    """Return mean readings, and behind them what is known beside them where anything is."""
    mean = experiment.readings.mean
    return mean if experiment.rates is None else np.concatenate([mean, experiment.told], axis=1)


def _settled(
    rows: ResponseRows, first: FluxStep, point: _Point, pull: Array
) -> tuple[_Point, FluxStep]:
    """Repeat steps until they settle: where they lead, and the last one's derivatives.

    A draw of the exact model's posterior lies beside its mode by what noise lets it. That stays as
    it is: readings and priors are taken to be off by what the first step leaves of them and what
    pulls all draws, so that the mode would be where the draw is.
    """
    e, d = rows.experiment, rows.experiment.z.size
    n, m = rows.along.shape
    off_by = first.left + pull
    left = off_by[: m * n].reshape(n, m)
    whitener = whiteners(e.sensor, e.readings)
    means, rates = _means(e), e.rates
    readings = means.copy()
    readings[:, :2] += np.linalg.solve(whitener, left[:, :2, None])[:, :, 0]
    if rates is not None:
        readings[:, 2:] += np.divide(left[:, 3:], rates, out=np.zeros((n, 2)), where=rates > 0)
    of_prior = off_by[m * n : m * n + d]

    def cost(by: _Point) -> float:
        if not np.abs(by.log_r).max(initial=0.0) < _FARTHEST:
            return math.inf
        with np.errstate(all="ignore"):
            off = readings - _means(_moved(e, by))
            off[:, :2] = np.einsum("nij,nj->ni", whitener, off[:, :2])
            if rates is not None:
                off[:, 2:] *= rates
            pulls = of_prior - by.z, by.error
            value = float(np.square(off).sum() + sum(np.square(pull).sum() for pull in pulls))
        return value if math.isfinite(value) else math.inf

    start, none = point, _Point(np.zeros(d), np.zeros(n), np.zeros(point.error.size))
    step, last = first, cost(none)
    if not cost(point) < last:  # half the way is nearer
        point = none
    else:
        last = cost(point)
    for _ in range(_STEPS):
        here = ResponseRows(_moved(e, point))
        off = here.residual(readings)
        off[:, 2] = left[:, 2] - rows.along[:, 2] * point.log_r
        tried = flux_step(here, off, of_prior - point.z)
        by = tried.coefficients(point.error)
        way = _Point(
            tried.by_readings[0] + tried.by_error[0] @ by,
            tried.by_readings[1] + tried.by_error[1] @ by,
            by,
        )
        share = 1.0
        while share > _SHORTEST:
            following = point.plus(way, share)
            if cost(following) < last:
                break
            share *= 0.5
        else:
            break
        point, step, gained = following, tried, last - cost(following)
        last -= gained
        if gained < _SETTLED:
            break
    return (start, first) if point is none else (point, step)


def curvature_of_response(experiment: Experiment, response: ModelResponse, normal: Array) -> Array:
    """Return how far the response misses where errors of the flux lead.

    Parameters
    ----------
    experiment : Experiment
        As for `model_response`.
    response : ModelResponse
        What that found.
    normal : ndarray, shape (t, k)
        The errors: standard normal variates beside the mean of what is known of them.

    Returns
    -------
    ndarray, shape (t,)
        Root mean square over the frames of what the next Gauss-Newton step would still move log r
        by; inf where it leads beyond what numbers hold.
    """
    e, rows = experiment, ResponseRows(experiment)
    present, missed = np.isfinite(e.log_r), np.zeros(len(normal))
    if not e.by_error.shape[2] or not present.any():
        return missed
    off = _beyond_linear(rows, response, normal)
    finite = np.isfinite(off).all(axis=(0, 1))
    missed[~finite] = math.inf
    again = _next_step(rows, off[:, :, finite])[present]
    with np.errstate(over="ignore"):
        missed[finite] = np.sqrt(np.mean(np.square(again), axis=0))
    return missed


def _beyond_linear(rows: ResponseRows, of: ModelResponse, normal: Array) -> Array:
    """Return what readings are off where errors lead, and not to first order, shape (n, m, t)."""
    e = rows.experiment
    z = of.shift[0] + normal @ of.parameters.T
    log_r = np.where(np.isfinite(e.log_r), of.shift[1] + normal @ of.log_r.T, 0.0)
    error = of.error.mean + normal @ of.error.spread.T
    with np.errstate(all="ignore"):
        ways = (_Point(*way) for way in zip(z, log_r, error, strict=True))
        seen = _means(e)[:, :, None] - np.stack([_means(_moved(e, by)) for by in ways], axis=2)
        off = np.zeros((*rows.along.shape, len(normal)))
        off[:, :2] = whiteners(e.sensor, e.readings) @ seen[:, :2]
        if e.rates is not None:
            off[:, 3:] = e.rates[:, :, None] * seen[:, 2:]
    # to first order the readings stay where they are, but for what across leaves of the error
    by_range = rows.along[:, :, None] * log_r.T[:, None]
    off += rows.by_error @ error.T + rows.jacobian @ z.T + by_range
    off[:, 2] = 0.0
    return off


def _next_step(rows: ResponseRows, off: Array) -> Array:
    """Return the change of log r, shape (n, t), with readings that are off, shape (n, m, t).

    The error follows them as well: all is one linear step, its orthogonal decomposition shared.
    """
    k = rows.by_error.shape[2]
    _, moved, left = rows.follow(np.concatenate([rows.by_error, off], axis=2))
    across, triangle = left[:, :k], error_triangle(left[:, :k])
    told = scipy.linalg.solve_triangular(triangle, across.T @ left[:, k:], trans="T")
    by_error = scipy.linalg.solve_triangular(triangle, told)
    return np.asarray(moved[:, k:] - moved[:, :k] @ by_error)
