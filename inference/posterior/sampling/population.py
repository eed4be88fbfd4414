"""A population carried from the prior to the posterior, its curved shape unbent on the way.

Sequential Monte Carlo with adaptive temperatures (Del Moral, Doucet, Jasra 2006); at every
temperature a triangular map is fitted to each half of the population, and independent jumps and
differential evolution move the other half in its coordinates (preconditioned Monte Carlo, Karamanis
et al. 2022, with polynomials in place of their normalising flow; halves as in Foreman-Mackey et al.
2013: a map fitted to the members that it moves draws them together, by a tenth of their spread).
Where crosstalk and a background are both unknown the posterior is a thin curved sheet, on which
plain moves stay where they were started.
"""

import dataclasses
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.aliases import Aliases, aliases_of
from inference.posterior.sampling.by_weight import systematic
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.effort import Effort, Move
from inference.posterior.sampling.transport import TriangularMap, fit_map, straight_map

__all__ = ["Population", "arrived_at", "carried", "first_population", "temper"]

Array = NDArray[np.float64]

_SCREEN = 4  # times as many are drawn from the prior
_LAST = 3.0  # times as many moves at the last temperature
_HOT = 1e-2  # power up to which one move suffices: what is lost there are not the ends of a sheet


@dataclasses.dataclass(frozen=True, eq=False)
class Population:
    """Members of a population at some temperature.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Members.
    log_likelihood, log_prior : ndarray, shape (n,)
        Of the members; the log prior up to the constant of `Parameters.log_prior`.
    power : float
        Of the likelihood: 0 is the prior, 1 the posterior.
    log_evidence : float
        Log of the mean likelihood over the prior, as far as the power has come.
    steps : int
        Temperatures so far.
    calls : int
        Density evaluations so far.
    """

    z: Array
    log_likelihood: Array
    log_prior: Array
    power: float
    log_evidence: float
    steps: int
    calls: int

    @property
    def ended(self) -> bool:
        """Whether it is at the posterior, or died on the way."""
        return self.power == 1.0 or len(self.z) == 0


def arrived_at(z: Array) -> Population:
    """Return points that stand for a population which has come to the posterior."""
    return Population(z, np.zeros(len(z)), np.zeros(len(z)), 1.0, 0.0, 0, 0)


def first_population(
    density: CollapsedDensity, rng: np.random.Generator, effort: Effort
) -> Population:
    """Draw a population from the prior.

    Returns
    -------
    Population
        Empty where the likelihood is zero at nearly every draw.
    """
    count = _SCREEN * effort.size
    z = density.parameters.sample(rng, count)
    likelihood = density.log_likelihood(z)
    finite = np.isfinite(likelihood)
    if finite.sum() < 4 * z.shape[1]:
        finite[:] = False
    z, likelihood = z[finite], likelihood[finite]
    share = math.log(len(z) / count) if len(z) else -math.inf
    return Population(z, likelihood, density.parameters.log_prior(z), 0.0, share, 0, count)


def _next_power(log_likelihood: Array, power: float) -> float:
    """Return the power at which half of the population still counts."""
    span = log_likelihood - log_likelihood.max()

    def surplus(step: float) -> float:
        weights = np.exp(step * span)
        return float(weights.sum() ** 2 / (weights**2).sum() - 0.5 * span.size)

    rest = 1.0 - power
    if surplus(rest) >= 0:
        return 1.0
    # a step can be far below 1e-12 where the first population fits very badly
    lower = np.log(rest) - 80.0
    upper = np.log(rest)
    found = scipy.optimize.brentq(lambda x: surplus(float(np.exp(x))), lower, upper, xtol=1e-3)
    return power + float(np.exp(found))


def _resampled(population: Population, size: int, rng: np.random.Generator) -> Population:
    """Raise the power as far as half of the population still counts, and resample."""
    likelihood = population.log_likelihood
    power = _next_power(likelihood, population.power)
    top = float(likelihood.max())
    step = power - population.power
    # copies of a member must fall into one half: a map that has seen them does not move them freely
    order = rng.permutation(len(likelihood))
    weights = np.exp(step * (likelihood[order] - top))
    gain = step * top + math.log(float(weights.mean()))
    index = order[systematic(weights, size, rng)]
    return dataclasses.replace(
        population,
        z=population.z[index],
        log_likelihood=likelihood[index],
        log_prior=population.log_prior[index],
        power=power,
        log_evidence=population.log_evidence + gain,
        steps=population.steps + 1,
    )


def _sweep(
    density: CollapsedDensity,
    population: Population,
    moving: slice,
    still: slice,
    transport: TriangularMap,
    rng: np.random.Generator,
    move: Move,
) -> tuple[Population, float]:
    """Move each member of one part once; return the share that moved."""
    x, old_det = transport.unbend(population.z[moving])
    others = transport.unbend(population.z[still])[0]
    new, ratio = move(x, others, rng)
    z, new_det = transport.bend(new)
    return _accepted(density, population, moving, z, ratio + new_det + old_det, rng)


def _accepted(
    density: CollapsedDensity,
    population: Population,
    moving: slice,
    z: Array,
    ratio: Array,
    rng: np.random.Generator,
) -> tuple[Population, float]:
    """Accept what is proposed to members, or not; return the share that moved."""
    log_prior = density.parameters.log_prior(z)
    likelihood = np.full(len(z), -np.inf)
    inside = np.isfinite(log_prior)
    likelihood[inside] = density.log_likelihood(z[inside])
    gain = log_prior - population.log_prior[moving]
    gain += population.power * (likelihood - population.log_likelihood[moving])
    gain += ratio
    accept = np.flatnonzero(np.log(rng.random(len(z))) < gain)
    place = moving.start + accept
    members, likelihoods, priors = (
        population.z.copy(),
        population.log_likelihood.copy(),
        population.log_prior.copy(),
    )
    members[place], likelihoods[place] = z[accept], likelihood[accept]
    priors[place] = log_prior[accept]
    moved = dataclasses.replace(
        population,
        z=members,
        log_likelihood=likelihoods,
        log_prior=priors,
        calls=population.calls + len(z),
    )
    return moved, accept.size / len(z)


def temper(
    density: CollapsedDensity, population: Population, rng: np.random.Generator, effort: Effort
) -> Population:
    """Carry a population to the next temperature.

    Parameters
    ----------
    population : Population
        From `first_population` or this function; not empty, power below 1.
    rng : numpy.random.Generator
        Source of randomness; one of its own for every temperature makes the steps a fold.

    Returns
    -------
    Population
        Its power is 1 when it has arrived.
    """
    coordinates = coordinates_of(density) if effort.unbends else None
    population = _resampled(population, effort.size, rng)
    wanted = 1.0 if population.power < _HOT else effort.wanted
    if population.power == 1.0:
        wanted *= _LAST
    parts = [slice(0, effort.size // 2), slice(effort.size // 2, effort.size)]
    if not effort.unbends:  # a whitening is too stiff to draw members together
        parts = [slice(0, effort.size)]
    moves = 0.0
    for sweep in range(int(effort.sweeps * wanted)):
        turn = sweep % len(effort.moves)
        if turn == 0:
            members = [population.z[part] for part in parts]
            maps = [fit_map(z, coordinates) if effort.unbends else straight_map(z) for z in members]
        for moving, still, transport in zip(parts, parts[::-1], maps[::-1], strict=True):
            population, moved = _sweep(
                density,
                population,
                moving,
                still,
                transport,
                rng,
                effort.moves[turn],
            )
            moves += moved / len(parts)
        if moves > wanted:
            break
    aliases = aliases_of(density)
    if aliases is None or population.steps % effort.turned:
        return population
    return _turned(density, aliases, population, rng)


def _turned(
    density: CollapsedDensity, aliases: Aliases, population: Population, rng: np.random.Generator
) -> Population:
    """Give every member an alias anew."""
    new, ratio = aliases.propose(population.z, rng)
    return _accepted(density, population, slice(0, len(new)), new, ratio, rng)[0]


def carried(density: CollapsedDensity, rng: np.random.Generator, effort: Effort) -> Population:
    """Carry a population all the way from the prior to the posterior.

    Returns
    -------
    Population
        Empty where the likelihood is zero at nearly every draw of the prior.
    """
    population = first_population(density, rng, effort)
    while not population.ended:
        population = temper(density, population, rng, effort)
    return population
