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
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.proposal import log_student, student
from inference.posterior.sampling.shear import Shear, shear_of
from inference.posterior.sampling.tempering import next_power
from inference.posterior.sampling.transport import TriangularMap, fit_map

__all__ = ["Population", "carried", "first_population", "temper"]

Array = NDArray[np.float64]

_SCREEN = 4  # times as many are drawn from the prior
_REFIT = 4  # sweeps with one map, of which the last is differential evolution
_SWEEPS = 20.0  # at most, for every accepted move that is wanted
_LAST = 3.0  # times as many moves at the last temperature
_HOT = 1e-2  # power up to which one move suffices: what is lost there are not the ends of a sheet


@dataclasses.dataclass(frozen=True)
class _Effort:
    """Members of a population, and accepted moves of each at a temperature."""

    size: int
    moves: float  # beyond `_HOT`


_EASY = _Effort(384, 1.0)


def _effort(shear: Shear | None, d: int) -> _Effort:
    """Return what a scene of d unknowns takes.

    Where crosstalk and background are confounded, the ends of the sheet that hold a quarter of the
    posterior are a hundredth of it at higher temperatures: a small population loses them, and one
    that hardly moves does not find them again. Half of it is enough for a whole quadratic map.
    """
    if shear is None:
        return _EASY
    return _Effort(12 * d * (d + 1), 3.0)


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


def first_population(density: CollapsedDensity, rng: np.random.Generator) -> Population:
    """Draw a population from the prior.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Population
        Empty where the likelihood is zero at nearly every draw.
    """
    count = _SCREEN * _effort(shear_of(density), len(density.parameters)).size
    z = density.parameters.sample(rng, count)
    likelihood = density.log_likelihood(z)
    finite = np.isfinite(likelihood)
    if finite.sum() < 4 * z.shape[1]:
        finite[:] = False
    z, likelihood = z[finite], likelihood[finite]
    share = math.log(len(z) / count) if len(z) else -math.inf
    return Population(z, likelihood, density.parameters.log_prior(z), 0.0, share, 0, count)


def _resampled(population: Population, size: int, rng: np.random.Generator) -> Population:
    """Raise the power as far as half of the population still counts, and resample."""
    likelihood = population.log_likelihood
    power = next_power(likelihood, population.power)
    top = float(likelihood.max())
    step = power - population.power
    # copies of a member must fall into one half: a map that has seen them does not move them freely
    order = rng.permutation(len(likelihood))
    weights = np.exp(step * (likelihood[order] - top))
    gain = step * top + math.log(float(weights.mean()))
    positions = (rng.random() + np.arange(size)) / size
    sums = np.cumsum(weights / weights.sum())
    index = order[np.minimum(np.searchsorted(sums, positions), len(weights) - 1)]
    return dataclasses.replace(
        population,
        z=population.z[index],
        log_likelihood=likelihood[index],
        log_prior=population.log_prior[index],
        power=power,
        log_evidence=population.log_evidence + gain,
        steps=population.steps + 1,
    )


def _trial(x: Array, others: Array, rng: np.random.Generator, jump: bool) -> tuple[Array, Array]:
    """Propose coordinates, and the log of the proposal's densities' ratio (old to new)."""
    n, d = x.shape
    if jump:
        new = student(rng, n, d)
        return new, log_student(x) - log_student(new)
    first, second = rng.integers(len(others), size=n), rng.integers(len(others), size=n)
    scale = 2.38 / math.sqrt(2 * d) * np.exp(0.5 * rng.standard_normal((n, 1)))
    if rng.random() < 0.2:
        scale = np.ones((n, 1))  # from mode to mode
    noise = 1e-4 * rng.standard_normal((n, d))
    return x + scale * (others[first] - others[second]) + noise, np.zeros(n)


def _half_sweep(
    density: CollapsedDensity,
    population: Population,
    moving: slice,
    still: slice,
    transport: TriangularMap,
    rng: np.random.Generator,
    jump: bool,
) -> tuple[Population, float]:
    """Move each member of one half once; return the share that moved."""
    x, old_det = transport.unbend(population.z[moving])
    others = transport.unbend(population.z[still])[0]
    new, ratio = _trial(x, others, rng, jump)
    z, new_det = transport.bend(new)
    log_prior = density.parameters.log_prior(z)
    likelihood = np.full(len(z), -np.inf)
    inside = np.isfinite(log_prior)
    likelihood[inside] = density.log_likelihood(z[inside])
    gain = log_prior - population.log_prior[moving]
    gain += population.power * (likelihood - population.log_likelihood[moving])
    gain += ratio + new_det + old_det
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
    density: CollapsedDensity, population: Population, rng: np.random.Generator
) -> Population:
    """Carry a population to the next temperature.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    population : Population
        From `first_population` or this function; not empty, power below 1.
    rng : numpy.random.Generator
        Source of randomness; one of its own for every temperature makes the steps a fold.

    Returns
    -------
    Population
        Its power is 1 when it has arrived.
    """
    shear = shear_of(density)
    effort = _effort(shear, len(density.parameters))
    population = _resampled(population, effort.size, rng)
    wanted = 1.0 if population.power < _HOT else effort.moves
    if population.power == 1.0:
        wanted *= _LAST
    halves = (slice(0, effort.size // 2), slice(effort.size // 2, effort.size))
    moves = 0.0
    for sweep in range(int(_SWEEPS * wanted)):
        if sweep % _REFIT == 0:
            maps = [fit_map(population.z[half], shear) for half in halves]
        for k in (0, 1):
            population, moved = _half_sweep(
                density,
                population,
                halves[k],
                halves[1 - k],
                maps[1 - k],
                rng,
                jump=sweep % _REFIT < _REFIT - 1,
            )
            moves += 0.5 * moved
        if moves > wanted:
            break
    return population


def carried(density: CollapsedDensity, rng: np.random.Generator) -> Population:
    """Carry a population all the way from the prior to the posterior.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    Population
        Empty where the likelihood is zero at nearly every draw of the prior.
    """
    population = first_population(density, rng)
    while not population.ended:
        population = temper(density, population, rng)
    return population
