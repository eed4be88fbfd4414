"""A population tempered in from the prior: a start that no optimum was told to.

Sequential Monte Carlo with adaptive temperatures (Del Moral, Doucet, Jasra 2006) and differential
evolution moves. Its walkers come from the prior alone, so an ensemble that starts from them can
contradict those that start from the optima.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from inference.density.collapsed import CollapsedDensity

__all__ = ["Population", "next_power", "temper", "tempered_walkers"]

Array = NDArray[np.float64]

_SWEEPS = 2  # moves of the whole population at each temperature
_LAST_SWEEPS = 6
_MOST_TEMPERATURES = 200


def next_power(log_likelihood: Array, power: float) -> float:
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
    found = optimize.brentq(lambda x: surplus(float(np.exp(x))), lower, np.log(rest), xtol=1e-3)
    return power + float(np.exp(found))


@dataclasses.dataclass(frozen=True, eq=False)
class Population:
    """Points that were brought from the prior to the posterior.

    Attributes
    ----------
    z : ndarray, shape (n, d)
        Points, some of them equal.
    log_likelihood, log_prior : ndarray, shape (n,)
        Of every point; the prior up to the constant of `Parameters.log_prior`.
    calls : int
        Density evaluations.
    """

    z: Array
    log_likelihood: Array
    log_prior: Array
    calls: int


def temper(density: CollapsedDensity, rng: np.random.Generator, count: int) -> Population:
    """Bring a population from the prior to the posterior.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    rng : numpy.random.Generator
        Source of randomness.
    count : int
        Size of the population; four times as many are drawn from the prior at first.

    Returns
    -------
    Population
        Empty where fewer than four draws of the prior explain the frames at all.
    """
    z = density.parameters.sample(rng, 4 * count)
    likelihood = density.log_likelihood(z)
    calls = len(z)
    finite = np.isfinite(likelihood)
    z, likelihood = z[finite][:count], likelihood[finite][:count]
    if len(z) < 4:
        return Population(z[:0], likelihood[:0], likelihood[:0], calls)
    count, d = z.shape
    prior = density.parameters.log_prior(z)
    power = 0.0
    jump = 2.38 / np.sqrt(2 * d)
    for _ in range(_MOST_TEMPERATURES):
        new_power = next_power(likelihood, power)
        weights = np.exp((new_power - power) * (likelihood - likelihood.max()))
        weights /= weights.sum()
        power = new_power
        positions = (rng.random() + np.arange(count)) / count
        index = np.minimum(np.searchsorted(np.cumsum(weights), positions), count - 1)
        z, likelihood, prior = z[index], likelihood[index], prior[index]
        for sweep in range(_LAST_SWEEPS if power == 1.0 else _SWEEPS):
            a, b = rng.permutation(count), rng.permutation(count)
            scale = 1.0 if sweep % 4 == 3 else jump * np.exp(0.3 * rng.standard_normal((count, 1)))
            spread = z.std(axis=0)
            noise = 0.02 * spread * rng.standard_normal(z.shape)
            trial = z + scale * (z[a] - z[b]) + noise
            trial_prior = density.parameters.log_prior(trial)
            trial_likelihood = density.log_likelihood(trial)
            calls += count
            gain = trial_prior - prior + power * (trial_likelihood - likelihood)
            accept = np.log(rng.random(count)) < gain
            z = np.where(accept[:, None], trial, z)
            prior = np.where(accept, trial_prior, prior)
            likelihood = np.where(accept, trial_likelihood, likelihood)
        if power == 1.0:
            break
    return Population(z, likelihood, prior, calls)


def tempered_walkers(
    density: CollapsedDensity, rng: np.random.Generator, walkers: int
) -> tuple[Array, int]:
    """Bring a population from the prior to the posterior.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    rng : numpy.random.Generator
        Source of randomness.
    walkers : int
        Size of the population that is returned; twice as many are carried along.

    Returns
    -------
    (ndarray, int)
        Distinct points of shape (walkers, d) as far as there are so many, by descending density,
        and the number of density evaluations.
    """
    found = temper(density, rng, 2 * walkers)
    total = found.log_likelihood + found.log_prior
    # a random half: the better half would lose a mode of little density, however wide
    _, first = np.unique(found.z, axis=0, return_index=True)
    kept = rng.permutation(first)[:walkers]
    return found.z[kept[np.argsort(-total[kept])]], found.calls
