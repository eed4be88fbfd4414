"""The spread that a posterior should have: information and priors together, linearised."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from inference.identifiability.experiment import Experiment
from inference.identifiability.sensitivity import term_changes, whiteners
from simulator.parameters import Parameters
from simulator.scene import Stroke

__all__ = ["Prediction", "log_range_spread", "predict"]

Array = NDArray[np.float64]

# the maps from z are smooth: a central difference errs by 1e-10 of itself, and an error of the map
# from the left multiplies the information, it is not added to it
_DIFFERENCE = 1e-5


@dataclasses.dataclass(frozen=True, eq=False)
class Prediction:
    """Posterior standard deviations of a normal approximation.

    Attributes
    ----------
    factor : ndarray, shape (d, d)
        F with F F^T the covariance of z, in which every prior is standard normal.
    range_sd : ndarray, shape (n,)
        Of log r of every frame; nan for a frame without object.
    scale_sd : float
        Of the mean of log r over the frames; nan where none has an object.
    """

    factor: Array
    range_sd: Array
    scale_sd: float

    @property
    def sd(self) -> Array:
        """Of z, shape (d,): 1 where the readings add nothing to the prior."""
        return np.asarray(np.linalg.norm(self.factor, axis=1))


def log_range_spread(parameters: Parameters) -> float:
    """Return the standard deviation of log r under its prior (of a normal, from its quantiles)."""
    law = parameters.range_prior
    if isinstance(law, Stroke):
        return math.log(law.high / law.low) / math.sqrt(12)
    low, high = law.from_normal(np.array([-1.0, 1.0]))
    return 0.5 * math.log(high / low)


def _limited(sd: Array, limit: float) -> Array:
    """Combine a standard deviation with that of a prior which has no curvature to add."""
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(1 / sd**2 + 1 / limit**2))


def predict(experiment: Experiment, whitener: Array | None = None) -> Prediction:
    """Predict the spread of the posterior.

    Parameters
    ----------
    experiment : Experiment
        Sensor, unknowns, their values, ranges.
    whitener : ndarray, shape (n, 2, 2), optional
        W with W^T W the inverse covariance of a frame's readings; left out: the sensor's.

    Returns
    -------
    Prediction
        The joint truncations of the prior and the bounds of the ranges' prior are not in it,
        except that no range is known worse than by its prior.
    """
    p = experiment.parameters
    z, d, n = experiment.z, len(p), experiment.log_r.size
    steps = _DIFFERENCE * np.eye(d)
    plus, minus = p.terms(z + steps), p.terms(z - steps)
    change = term_changes(experiment.terms, plus, minus) / (2 * _DIFFERENCE)
    of = experiment.readings
    with np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore"):
        if whitener is None:
            whitener = whiteners(experiment.sensor, of)
        jacobian = np.zeros((n, 3, d))
        jacobian[:, :2] = np.einsum("nij,njk->nik", whitener, of.by_term) @ change
        along = np.zeros((n, 3))
        along[:, :2] = np.einsum("nij,nj->ni", whitener, of.by_range)
    present = np.isfinite(experiment.log_r)
    law = experiment.terms.ranges[0]
    r = np.exp(experiment.log_r[present])
    along[present, 2] = np.sqrt(law[5] ** 2 + (r * law[3]) ** 2)
    extra = [np.eye(d)]
    if isinstance(p.range_prior, Stroke):
        centre = (plus.ranges[:, 4] - minus.ranges[:, 4]) / (2 * _DIFFERENCE)
        jacobian[present, 2] = -centre * law[5]
        extra.append(_spread_rows(along[present], plus.ranges, minus.ranges, law[5]))
    length = np.linalg.norm(along, axis=1)
    moves = present & (length > 0)
    unit = np.where(moves[:, None], along, 0.0) / np.where(moves, length, 1.0)[:, None]
    shift = np.einsum("ni,nid->nd", unit, jacobian)
    across = jacobian - unit[:, :, None] * shift[:, None, :]
    factor = np.empty((0, 0))
    if d > 0:
        triangle = linalg.qr(np.concatenate([across.reshape(-1, d), *extra]), mode="r")[0][:d]
        factor = np.asarray(linalg.solve_triangular(triangle, np.eye(d)))
    variance, response = np.full(n, np.inf), np.zeros((n, d))
    variance[moves] = 1 / length[moves] ** 2
    response[moves] = -shift[moves] / length[moves, None]
    range_sd = np.sqrt(variance + np.linalg.norm(response @ factor, axis=1) ** 2)
    range_sd = np.where(present, _limited(range_sd, log_range_spread(p)), np.nan)
    return Prediction(factor, range_sd, _scale_sd(experiment, variance, response, factor))


def _spread_rows(along: Array, plus: Array, minus: Array, inverse: float) -> Array:
    """Information of independent ranges on the spread w of their log-normal prior.

    A log range read with variance s^2 is normal with variance v = w^2 + s^2, whose information on
    w is (dv/dw)^2 / (2 v^2) = 2 w^2 / v^2.
    """
    rate = (1 / plus[:, 5] - 1 / minus[:, 5]) / (2 * _DIFFERENCE)  # dw / dz
    w = 1 / inverse
    with np.errstate(divide="ignore"):
        own = 1 / (along[:, 0] ** 2 + along[:, 1] ** 2)
    return np.asarray(np.sqrt(np.sum(2 * w**2 / (w**2 + own) ** 2)) * rate[None])


def _scale_sd(experiment: Experiment, variance: Array, response: Array, factor: Array) -> float:
    """Return the spread of the mean of log r, which the ranges' support bounds."""
    present = np.isfinite(experiment.log_r)
    n = int(present.sum())
    if n == 0:
        return math.nan
    shared = np.linalg.norm(response[present].mean(axis=0) @ factor)
    sd = np.sqrt(variance[present].sum() / n / n + shared**2)
    where = experiment.log_r[present]
    low, high = experiment.terms.ranges[0, 6:8]
    with np.errstate(divide="ignore"):
        room = float(np.log(high) - np.log(low) - np.ptp(where))
    limit = room / math.sqrt(12) if room > 0 else math.inf
    limit = min(limit, log_range_spread(experiment.parameters))
    return float(_limited(np.array([sd]), limit)[0])
