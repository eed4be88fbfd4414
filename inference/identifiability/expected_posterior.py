"""The spread that a posterior should have: information and priors together, linearised."""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.frame.known_range import offset_slopes
from inference.identifiability.clock import as_ruled
from inference.identifiability.experiment import Experiment
from inference.identifiability.shared_errors import fewer
from simulator.parameters import Parameters
from simulator.scene import Reference, Stroke

__all__ = [
    "STEP",
    "ExpectedPosterior",
    "eliminated",
    "expected_posterior",
    "log_range_spread",
    "told_rows",
]

Array = NDArray[np.float64]

# the maps from z are smooth: a central difference errs by 1e-10 of itself, and an error of the map
# from the left multiplies the information, it is not added to it
STEP = 1e-5
_LOG_MEAN, _LOG_INVERSE_SD = 4, 5  # columns of `simulator.parameters.Terms.ranges`


@dataclasses.dataclass(frozen=True, eq=False)
class ExpectedPosterior:
    """Posterior standard deviations of a normal approximation.

    Attributes
    ----------
    factor : ndarray, shape (d, k)
        F with F F^T the covariance of z, in which every prior is standard normal.
    sd : ndarray, shape (d,)
        Of each unknown's own coordinate (`Parameters.marginal`): 1 where the readings add nothing
        to the prior.
    range_sd : ndarray, shape (n,)
        Of log r of every frame; nan for a frame without object.
    scale_sd : float
        Of the mean of log r over the frames; nan where none has an object.
    """

    factor: Array
    sd: Array
    range_sd: Array
    scale_sd: float


def log_range_spread(parameters: Parameters) -> float:
    """Return the standard deviation of log r under its prior (of a normal, from its quantiles)."""
    law = parameters.range_prior
    if isinstance(law, Stroke | Reference):
        return math.log(law.high / law.low) / math.sqrt(12)
    low, high = law.from_normal(np.array([-1.0, 1.0]))
    return 0.5 * math.log(high / low)


def _limited(sd: Array, limit: float, curved: bool) -> Array:
    """Combine a standard deviation with that of the ranges' prior, once."""
    if curved:  # it was one of the rows
        return np.minimum(sd, limit)
    if limit == 0.0:  # a law so narrow that its ends are one number
        return np.zeros_like(sd)
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(1 / sd**2 + 1 / limit**2))


def expected_posterior(experiment: Experiment, frames: int | None = None) -> ExpectedPosterior:
    """Return the spread that the posterior is expected to have.

    Parameters
    ----------
    experiment : Experiment
        Sensor, unknowns, their values, ranges. What is ``known`` after all keeps its place: the
        readings are taken not to depend on it.
    frames : int, optional
        Of how many frames, the first, the scale is asked; left out: of all.

    Returns
    -------
    ExpectedPosterior
        The joint truncations of the prior and the bounds of the ranges' prior are not in it,
        except that no range is known worse than by its prior.
    """
    p, present = experiment.parameters, np.isfinite(experiment.log_r)
    law = experiment.range_prior
    curved = law.inverse_sd > 0 or law.log_inverse_sd > 0
    curved = curved and not isinstance(p.range_prior, Stroke)  # whose support is no row
    d, (jacobian, along, extra) = len(p), told_rows(experiment)
    errors = fewer(jacobian[:, :, d:])
    k = errors.shape[2]
    jacobian = np.concatenate([jacobian[:, :, :d], errors], axis=2)
    # rows of z alone know of no errors
    extra = [np.eye(d + k), *(np.pad(rows[:, :d], ((0, 0), (0, k))) for rows in extra[1:])]
    across, response, variance = eliminated(experiment, jacobian, along)
    independent = 1 if experiment.common_range else int(present.sum())
    room = _room(experiment)
    if math.isfinite(room):
        # a scale that is known to the room which the support leaves tells of what moves with it
        own = math.sqrt(variance[present].mean() / independent)
        extra.append(response[present].mean(axis=0)[None] / math.hypot(room, own))
    unknowns = d + k
    factor = np.empty((0, 0))
    if unknowns > 0:
        rows = np.concatenate([across.reshape(-1, unknowns), *extra])
        triangle = scipy.linalg.qr(rows, mode="r")[0][:unknowns]
        factor = np.asarray(scipy.linalg.solve_triangular(triangle, np.eye(unknowns)))
    sd = np.linalg.norm(p.marginal(factor[:d].T), axis=0)
    share, ruled = as_ruled(experiment.rates, experiment.log_r, experiment.range_error)
    variance = variance * share**2 + ruled
    moved = (response * share[:, None]) @ factor
    drifts = experiment.drifts(_share_of_readings(along))
    if drifts is not None:
        moved = np.concatenate([moved, drifts], axis=1)
    range_sd = np.sqrt(variance + np.linalg.norm(moved, axis=1) ** 2)
    range_sd = np.where(present, _limited(range_sd, log_range_spread(p), curved), np.nan)
    asked = present & (np.arange(present.size) < (present.size if frames is None else frames))
    if not asked.any():
        return ExpectedPosterior(factor[:d], sd, range_sd, math.nan)
    independent = 1 if experiment.common_range else int(asked.sum())
    scale = math.hypot(
        math.sqrt(float(variance[asked].mean()) / independent),
        float(np.linalg.norm(moved[asked].mean(axis=0))),
    )
    limit = min(room, log_range_spread(p))
    scale_sd = float(_limited(np.array([scale]), limit, curved)[0])
    return ExpectedPosterior(factor[:d], sd, range_sd, scale_sd)


def _share_of_readings(along: Array) -> Array:
    """Return the share of the information on log r that is the readings', not its prior's."""
    told = np.square(along)
    whole = told.sum(axis=1)
    of_readings = told[:, :2].sum(axis=1)
    return np.asarray(np.divide(of_readings, whole, out=np.zeros_like(whole), where=whole > 0))


def told_rows(experiment: Experiment) -> tuple[Array, Array, list[Array]]:
    """Return what readings and priors tell.

    Of every frame two whitened readings and the prior of its range, and where something is known of
    ranges beside the readings also that: derivatives along z and the coefficients of the flux's
    error, shape (n, 3 or 5, d + k), and along its log r, shape (n, 3 or 5). Further rows tell of z
    alone.
    """
    p, log_r = experiment.parameters, experiment.log_r
    by_term, by_range, by_error = experiment.whitened_terms()
    d, n, k = len(p), log_r.size, by_error.shape[-1]
    rates = experiment.rates
    m = 3 if rates is None else 5
    jacobian, along = np.zeros((n, m, d + k)), np.zeros((n, m))
    with np.errstate(over="ignore", invalid="ignore"):
        jacobian[:, :2, :d] = by_term @ experiment.change
    jacobian[:, :2, [p.names.index(name) for name in experiment.known]] = 0.0
    jacobian[:, :2, d:] = by_error
    along[:, :2] = by_range
    present = np.isfinite(log_r)
    law = experiment.range_prior
    along[present, 2] = np.sqrt(
        law.log_inverse_sd**2 + (np.exp(log_r[present]) * law.inverse_sd) ** 2
    )
    if rates is not None:
        along[present, 3:] = np.exp(log_r[present])[:, None] * rates[present]
        slopes = offset_slopes(p, experiment.z)
        jacobian[present, 4, :d] = -rates[present, 1, None] * slopes
        jacobian[:, 4, [p.names.index(name) for name in experiment.known]] = 0.0
    extra = [np.eye(d + k)]
    if isinstance(p.range_prior, Stroke):
        steps = STEP * np.eye(d)
        plus, minus = p.terms(experiment.z + steps).ranges, p.terms(experiment.z - steps).ranges
        centre = (plus[:, _LOG_MEAN] - minus[:, _LOG_MEAN]) / (2 * STEP)
        jacobian[present, 2, :d] = -centre * law.log_inverse_sd
        told = np.square(np.delete(along[present], 2, axis=1)).sum(axis=1)
        if experiment.common_range:
            told = told.sum(keepdims=True)  # one range, however often it was read
        spread = _spread_row(told, plus, minus, law.log_inverse_sd)
        extra.append(np.append(spread, np.zeros(k))[None])
    if experiment.common_range and present.any():
        # one range, one prior of it
        along[np.flatnonzero(present)[1:], 2] = 0.0
        jacobian[np.flatnonzero(present)[1:], 2] = 0.0
    along[~present] = 0.0
    return jacobian, along, extra


def eliminated(experiment: Experiment, jacobian: Array, along: Array) -> tuple[Array, Array, Array]:
    """Eliminate the ranges: what is across them, how log r responds, and its own variance."""
    n, _, unknowns = jacobian.shape
    length = np.linalg.norm(along, axis=1)
    if experiment.common_range:
        length = np.full(n, np.linalg.norm(length))
    moves = np.isfinite(experiment.log_r) & (length > 0)
    unit = along / np.where(length > 0, length, 1.0)[:, None]
    shift = np.einsum("ni,nid->nd", unit, jacobian)
    if experiment.common_range:
        shift = np.broadcast_to(shift.sum(axis=0), shift.shape)
    across = jacobian - unit[:, :, None] * shift[:, None, :]
    variance, response = np.full(n, np.inf), np.zeros((n, unknowns))
    variance[moves] = 1 / length[moves] ** 2
    response[moves] = -shift[moves] / length[moves, None]
    return across, response, variance


def _room(experiment: Experiment) -> float:
    """Return how far the ranges can move together inside the support of their prior.

    The standard deviation of log r that a flat prior leaves to a common shift; inf for a prior
    whose curvature says more, and where no frame has an object.
    """
    present = np.isfinite(experiment.log_r)
    law = experiment.range_prior
    if not present.any() or law.inverse_sd > 0 or law.log_inverse_sd > 0 or not law.low > 0:
        return math.inf
    room = math.log(law.high / law.low) - float(np.ptp(experiment.log_r[present]))
    return room / math.sqrt(12) if room > 0 else math.inf


def _spread_row(told: Array, plus: Array, minus: Array, inverse: float) -> Array:
    """Information of independent ranges on the spread w of their log-normal prior.

    The readings' information on each log range is ``told``. A log range read with variance s^2 is
    normal with variance v = w^2 + s^2, whose information on w is (dv/dw)^2 / (2 v^2) =
    2 w^2 / v^2.
    """
    rate = (1 / plus[:, _LOG_INVERSE_SD] - 1 / minus[:, _LOG_INVERSE_SD]) / (2 * STEP)  # dw / dz
    w = 1 / inverse
    with np.errstate(divide="ignore"):
        own = 1 / told
    return np.asarray(np.sqrt(np.sum(2 * w**2 / (w**2 + own) ** 2)) * rate)
