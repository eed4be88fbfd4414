"""The evidence of a model: the probability of the frames with everything unknown integrated out.

Importance sampling from a mixture around the optima, where its weights can be trusted; otherwise
through a map fitted to two populations that were carried from the prior; otherwise bridge sampling
between each population and the map of the other. All in nats, on one scale for models of any
dimension: priors normalised, joint truncations included.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.effort import effort_of, scouts
from inference.posterior.sampling.importance import WeightedDraws, draw_weighted
from inference.posterior.sampling.population import Population, carried
from inference.posterior.sampling.proposal import Mixture, Proposal, mixture_of
from inference.posterior.sampling.start import Optimum, climb, find_optima, refine
from inference.posterior.sampling.transport import fit_map
from inference.posterior.selection.bridge import bridge
from simulator.parameters import Parameters

__all__ = ["Evidence", "Weighed", "adapt", "log_prior_mass", "resample", "weigh"]

Array = NDArray[np.float64]

# stricter than for means: just below 0.5 a far tail was missed that held a third of the mass
_MAX_K_HAT = 0.4
_DRAWS = 2000
_LEAST_ESS = 100.0
_SCOUTS = 128  # that look for optima which the multistart missed
_MAPPED_DRAWS = 4000
_BRIDGE_DRAWS = 2000
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
        points = scipy.stats.qmc.Sobol(d, rng=rng).random_base2(_PRIOR_POINTS)
        z = scipy.special.ndtri(np.clip(points, 1e-12, 1 - 1e-12))
        excess = parameters.log_prior(z) + 0.5 * np.einsum("ij,ij->i", z, z)
        means.append(float(scipy.special.logsumexp(excess)) - math.log(len(z)))
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
        if not any(other.is_near(optimum.z) for other in kept):
            kept.append(optimum)
    return kept


def adapt(laplace: Mixture, pilot: Array, density: CollapsedDensity) -> Mixture | Proposal:
    """Adapt a proposal to pilot draws, of which many may be equal.

    Parameters
    ----------
    laplace : Mixture
        Laplace approximations at the optima, which keep a share.
    pilot : ndarray, shape (n, d)
        Draws.
    density : CollapsedDensity
        Whose unknowns may be confounded.

    Returns
    -------
    Mixture or Proposal
        `laplace` itself where the draws are too few to have a shape.
    """
    if len(np.unique(pilot, axis=0)) < 10 * (pilot.shape[1] + 1):
        return laplace
    return Proposal(laplace, fit_map(pilot, coordinates_of(density)), 1.0)


def resample(weighted: WeightedDraws, rng: np.random.Generator, n: int) -> NDArray[np.intp]:
    """Choose draws by weight, the largest weights cut (Ionides 2008), so that no few take all.

    Parameters
    ----------
    weighted : WeightedDraws
        Draws, at least one of positive density.
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


def weigh(
    density: CollapsedDensity, rng: np.random.Generator, found: Sequence[Optimum] | None = None
) -> Weighed:
    """Estimate the evidence of a model.

    Parameters
    ----------
    found : sequence of Optimum or None
        Maxima of the density; None: they are looked for.

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
    optima = find_optima(density, rng) if found is None else list(found)
    scouted = carried(density, rng, scouts(_SCOUTS))
    calls = scouted.calls
    if len(scouted.z):
        best = scouted.z[np.argmax(scouted.log_likelihood + scouted.log_prior)]
        ends = [refine(density, climb(density, best)[0]), refine(density, best)]
        optima += [optimum for optimum in ends if optimum is not None]
    optima = _distinct(optima)
    if not optima:
        nothing = Evidence(-math.inf, 0.0, None)
        return Weighed(nothing, np.empty((0, d)), np.empty(0), None, calls)
    laplace = mixture_of(optima)
    weighted = draw_weighted(density, laplace, rng, _DRAWS)
    calls += _DRAWS
    if _trusted(weighted):
        return _by_importance(weighted, laplace, (constant, constant_error), calls)
    effort = effort_of(density)
    populations = [carried(density, rng, effort) for _ in range(2)]
    calls += sum(each.calls for each in populations)
    members = np.concatenate([each.z for each in populations])
    if not len(members):
        # the prior hardly ever explains the frames: only the optima are known, and two accounts of
        # them are as far off as they differ
        rough = float(scipy.special.logsumexp([optimum.log_mass for optimum in optima]))
        apart = abs(weighted.log_evidence - rough)
        return _by_importance(
            weighted, laplace, (constant, math.hypot(constant_error, apart)), calls
        )
    weighted = draw_weighted(density, adapt(laplace, members, density), rng, _MAPPED_DRAWS)
    calls += _MAPPED_DRAWS
    if _trusted(weighted):
        return _by_importance(weighted, laplace, (constant, constant_error), calls)
    value, error = _by_bridge(density, laplace, populations, rng)
    calls += 2 * _BRIDGE_DRAWS
    evidence = Evidence(value + constant, math.hypot(error, constant_error), None)
    return Weighed(evidence, members, np.zeros(len(members)), laplace, calls)


def _trusted(weighted: WeightedDraws) -> bool:
    return weighted.k_hat < _MAX_K_HAT and weighted.ess > _LEAST_ESS


def _by_importance(
    weighted: WeightedDraws, laplace: Mixture, constant: tuple[float, float], calls: int
) -> Weighed:
    error = math.hypot(_relative_error(weighted), constant[1])
    evidence = Evidence(weighted.log_evidence + constant[0], error, weighted.k_hat)
    with np.errstate(divide="ignore"):
        return Weighed(evidence, weighted.z, np.log(weighted.weights), laplace, calls)


def _by_bridge(
    density: CollapsedDensity,
    laplace: Mixture,
    populations: list[Population],
    rng: np.random.Generator,
) -> tuple[float, float]:
    """Bridge each population to the map of the other, which it was not fitted to.

    Two populations that came from the prior apart contradict each other where one missed something:
    half of their difference is the standard error of the mean, and so is the batches' own.
    """
    halves = [(each.z, each.log_likelihood + each.log_prior) for each in populations]
    if not all(len(z) for z, _ in halves):  # one of them died on the way
        z, at = halves[0] if len(halves[0][0]) else halves[1]
        order = rng.permutation(len(z))
        halves = [(z[part], at[part]) for part in (order[::2], order[1::2])]
    values, errors = [], []
    for k, (z, at) in enumerate(halves):
        proposal = adapt(laplace, halves[1 - k][0], density)
        drawn = draw_weighted(density, proposal, rng, _BRIDGE_DRAWS)
        value, error = bridge(z, at, proposal, drawn.z, drawn.log_density)
        values.append(value)
        errors.append(error)
    spread = 0.5 * abs(values[0] - values[1])
    return float(np.mean(values)), math.hypot(spread, float(np.mean(errors)))
