"""The evidence of a model: the probability of the frames with everything unknown integrated out.

Importance sampling from a mixture around the optima, where its weights can be trusted; otherwise
from a mixture adapted to a population that was tempered in from the prior; otherwise bridge
sampling between such a mixture and walkers. All in nats, on one scale for models of any
dimension: priors normalised, joint truncations included.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.stats import qmc

from inference.posterior.bridge import bridge, walk
from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.importance import WeightedDraws, draw_weighted
from inference.posterior.local_mixture import adapted
from inference.posterior.proposal import Mixture, mixture_of
from inference.posterior.start import Optimum, climb, find_optima, refine
from inference.posterior.tempering import temper
from simulator.parameters import Parameters

__all__ = ["Evidence", "Weighed", "adapt", "log_prior_mass", "resample", "weigh"]

Array = NDArray[np.float64]

# stricter than for means: just below 0.5 a far tail was missed that held a third of the mass
_MAX_K_HAT = 0.4
_DRAWS = 2000
_LEAST_ESS = 100.0
_TRIALS = 3  # of importance sampling, from one mixture after another
_POPULATION = 128
_WALKERS = 128
_WALKS = 3
_STEPS = 160
_MOST_EVALUATIONS = 1_000_000  # of a frame, in one walk
# nats for each unknown beyond three, where no quadrature can check: in nine dimensions estimates
# from other populations were seen to differ by 1.5 nats though each was stable in itself
_UNCHECKED = 0.25
_PRIOR_POINTS = 13  # log2
_PRIOR_REPEATS = 4


@dataclasses.dataclass(frozen=True)
class Evidence:
    """Log evidence of a model.

    Attributes
    ----------
    log_evidence : float
        log p(frames | model) [nat], the frames' density in reading units; -inf where no parameters
        within their priors explain the frames.
    error : float
        Its standard error.
    k_hat : float or None
        Of the importance weights behind it; None with bridge sampling, or nothing unknown.
    """

    log_evidence: float
    error: float
    k_hat: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class Weighed:
    """Evidence, and weighted draws of the posterior.

    Attributes
    ----------
    evidence : Evidence
        Its evidence.
    z : ndarray, shape (n, d)
        Draws.
    log_weights : ndarray, shape (n,)
        Log of their weights, not normalised.
    laplace : Mixture or None
        Laplace approximations at the optima; None where there are none.
    calls : int
        Density evaluations.
    """

    evidence: Evidence
    z: Array
    log_weights: Array
    laplace: Mixture | None
    calls: int


def log_prior_mass(parameters: Parameters, rng: np.random.Generator) -> tuple[float, float]:
    """Integrate the prior that `Parameters.log_prior` leaves without its constant.

    Parameters
    ----------
    parameters : Parameters
        The unknowns.
    rng : numpy.random.Generator
        Scrambles the points of the integral.

    Returns
    -------
    (float, float)
        Log of the mean over the standard normal of exp(log corrections), zero for priors without a
        joint truncation, and its standard error.
    """
    d = len(parameters)
    cut = any(unknown.log_correction for unknown in parameters.unknowns)
    if not cut:
        return 0.0, 0.0
    means = []
    for _ in range(_PRIOR_REPEATS):
        points = qmc.Sobol(d, rng=rng).random_base2(_PRIOR_POINTS)
        z = special.ndtri(np.clip(points, 1e-12, 1 - 1e-12))
        excess = parameters.log_prior(z) + 0.5 * np.einsum("ij,ij->i", z, z)
        means.append(float(special.logsumexp(excess)) - math.log(len(z)))
    return _pool(np.array(means))


def _pool(logs: Array) -> tuple[float, float]:
    """Log of the mean of estimates given by their logs, and its standard error."""
    top = float(logs.max())
    if not math.isfinite(top):
        return -math.inf, 0.0
    values = np.exp(logs - top)
    mean = float(values.mean())
    error = float(values.std(ddof=1)) / math.sqrt(values.size) / mean
    return top + math.log(mean), error


def _constant(parameters: Parameters, rng: np.random.Generator) -> tuple[float, float]:
    """Return what a density's log integral lacks of the log evidence, and its standard error."""
    mass, error = log_prior_mass(parameters, rng)
    return -0.5 * len(parameters) * math.log(2 * math.pi) - mass, error


def _relative_error(weighted: WeightedDraws) -> float:
    """Relative standard error of the mean of importance weights."""
    return math.sqrt(max(1 / weighted.ess - 1 / len(weighted.weights), 0.0))


def _distinct(optima: list[Optimum]) -> list[Optimum]:
    """Drop optima that lie within half a standard deviation of a better one."""
    kept: list[Optimum] = []
    for optimum in sorted(optima, key=lambda o: -o.log_density):
        steps = [np.linalg.solve(other.factor, optimum.z - other.z) for other in kept]
        if all(np.linalg.norm(step) >= 0.5 for step in steps):
            kept.append(optimum)
    return kept


def adapt(laplace: Mixture, pilot: Array, rng: np.random.Generator) -> Mixture:
    """Adapt a mixture to pilot draws, of which many may be equal.

    Parameters
    ----------
    laplace : Mixture
        Laplace approximations at the optima, which keep a share.
    pilot : ndarray, shape (n, d)
        Draws.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Mixture
        `laplace` itself where the draws are too few to have a shape.
    """
    distinct = np.unique(pilot, axis=0)
    if len(distinct) < 10 * (pilot.shape[1] + 1):
        return laplace
    return adapted(laplace, distinct, rng)


def resample(weighted: WeightedDraws, rng: np.random.Generator, n: int) -> NDArray[np.intp]:
    """Choose draws by weight, the largest weights cut (Ionides 2008), so that no few take all.

    Parameters
    ----------
    weighted : WeightedDraws
        Draws, at least one of positive density.
    rng : numpy.random.Generator
        Source of randomness.
    n : int
        How many.

    Returns
    -------
    ndarray, shape (n,)
        Indices, some of them equal.
    """
    weights = np.minimum(weighted.weights, math.sqrt(len(weighted.z)) / len(weighted.z))
    weights = np.where(np.isfinite(weighted.log_density), weights, 0.0)
    chosen: NDArray[np.intp] = rng.choice(len(weights), size=n, p=weights / weights.sum())
    return chosen


def weigh(density: CollapsedDensity, rng: np.random.Generator) -> Weighed:
    """Estimate the evidence of a model.

    Parameters
    ----------
    density : CollapsedDensity
        Its collapsed density.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Weighed
        Without draws where no parameters explain the frames.
    """
    d = len(density.parameters)
    if d == 0:
        value = float(density(np.empty((1, 0)))[0])
        return Weighed(Evidence(value, 0.0, None), np.empty((1, 0)), np.zeros(1), None, 1)
    constant, constant_error = _constant(density.parameters, rng)
    optima = find_optima(density, rng)
    population = temper(density, rng, _POPULATION)
    calls = population.calls
    if len(population.z):
        best = population.z[np.argmax(population.log_likelihood + population.log_prior)]
        found = [refine(density, climb(density, best)[0]), refine(density, best)]
        optima += [optimum for optimum in found if optimum is not None]
    optima = _distinct(optima)
    if not optima:
        nothing = Evidence(-math.inf, 0.0, None)
        return Weighed(nothing, np.empty((0, d)), np.empty(0), None, calls)
    mixture = laplace = mixture_of(optima)
    pilot = population.z
    for trial in range(_TRIALS):
        weighted = draw_weighted(density, mixture, rng, _DRAWS)
        calls += _DRAWS
        if weighted.k_hat < _MAX_K_HAT and weighted.ess > _LEAST_ESS:
            error = math.hypot(_relative_error(weighted), constant_error)
            evidence = Evidence(weighted.log_evidence + constant, error, weighted.k_hat)
            with np.errstate(divide="ignore"):
                return Weighed(evidence, weighted.z, np.log(weighted.weights), laplace, calls)
        if trial:
            pilot = np.concatenate([population.z, weighted.z[resample(weighted, rng, _DRAWS)]])
        if np.linalg.matrix_rank(pilot - pilot[:1]) < d:
            pilot = mixture.draw(rng, _DRAWS)
        mixture = adapt(laplace, pilot, rng)
    values = []
    z = weighted.z[resample(weighted, rng, _WALKERS)]
    steps = int(np.clip(_MOST_EVALUATIONS / _WALKERS / len(density.frames), 40, _STEPS))
    for _ in range(_WALKS):
        walked = walk(density, mixture, z, rng, steps)
        weighted = draw_weighted(density, mixture, rng, _DRAWS)
        calls += walked.calls + _DRAWS
        value, error = bridge(walked, mixture, weighted.z, weighted.log_density)
        values.append(value)
        z = walked.z[-1]
        pilot = walked.z.reshape(-1, d)
        mixture = adapt(laplace, pilot, rng)
    # a population that still drifts shows in the last two estimates
    drift = abs(values[-1] - values[-2])
    error = math.hypot(max(error, drift, _UNCHECKED * (d - 3)), constant_error)
    evidence = Evidence(values[-1] + constant, error, None)
    return Weighed(evidence, pilot, np.zeros(len(pilot)), laplace, calls)
