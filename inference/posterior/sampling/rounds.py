"""Importance sampling in rounds: every proposal is fitted to the draws of all rounds before it.

Adaptive multiple importance sampling (Cornuet et al. 2012): a draw of any round is weighted by the
mixture of all proposals (Owen and Zhou 2000), so that what one of them leaves out another holds.
One of two maps is fitted to draws that are weighted to a smaller power of the target: along a thin
ridge, where populations come slowly, it reaches beyond them. Besides, every round has a law around
the place where the target exceeds the mixture most (incremental mixtures, Raftery and Bao 2010): no
polynomial follows a narrow second mode. Members of populations that came from the prior begin it,
and are what it is held to. The draws that count are made at the end, from proposals that are fitted
no more.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, special

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.flux_coordinate import coordinates_of
from inference.posterior.sampling.importance import (
    MAX_SMOOTHED_K_HAT,
    WeightedDraws,
    pareto_k_hat,
    weighted_by,
)
from inference.posterior.sampling.pool import (
    Pool,
    drawn_by,
    joined,
    mixed,
    shares_that_suit,
    with_laws,
)
from inference.posterior.sampling.proposal import Local, Mixture, Proposal, completed
from inference.posterior.sampling.transport import fit_map

__all__ = ["Rounds", "in_rounds"]

Array = NDArray[np.float64]

_DRAWS = 1000  # of a round
_LOCAL_SHARE = 0.25  # of them, from around the place that the others hold least of
_WIDE_SHARE = 0.35  # of them, from a map fitted to draws of
_WIDE = (0.15, 0.5)  # these powers of the target, by turns
_FEWEST, _LAWS = 6, 3  # rounds, and laws of each
_NEIGHBOURS = 10  # for every unknown, that such a law is fitted to; or
_NEAR = 0.05  # of all draws
_LEAST = 2000  # draws that count: the shape of their weights' tail is known to 0.13
_MOST = 20_000  # of them
_TAIL = 0.01  # of the draws' mass, in the heaviest of them: there may be
_MOST_DISSENT = 0.03  # so many of a population's members
_SPARE = 1.3  # times the draws that are foreseen
_FITTED = 2000  # draws that a map is fitted to
_LEAST_ESS = 150.0  # of them, and
_PER_PAIR = 4.0  # times the square of the unknowns: weights are flattened until there are as many


@dataclasses.dataclass(frozen=True, eq=False)
class Rounds:
    """What importance sampling in rounds came to.

    Attributes
    ----------
    proposal : Proposal
        With the last map, and laws of any round that hold the places of which it holds too little.
    draws : WeightedDraws
        Those that count.
    dissent : float
        Largest share of a population's members at which the target exceeds the proposals by more
        than at the heaviest draws.
    calls : int
        Density evaluations.
    tolerated : float
        Dissent below which the draws stand.
    """

    proposal: Proposal
    draws: WeightedDraws
    dissent: float
    calls: int
    tolerated: float

    @property
    def trusted(self) -> bool:
        """Whether the draws stand for the posterior, however many they are."""
        return self.draws.k_hat < MAX_SMOOTHED_K_HAT and self.dissent < self.tolerated


def in_rounds(
    density: CollapsedDensity,
    proposal: Proposal,
    populations: tuple[Array, ...],
    rng: np.random.Generator,
    target_ess: int,
    most: int,
    tolerated: float = _MOST_DISSENT,
    tail: float = _TAIL,
) -> Rounds:
    """Draw by importance, in rounds that follow what was drawn.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    proposal : Proposal
        With the optima that are known.
    populations : tuple of ndarray, shape (m, d) each
        Members of populations that came from the prior, of finite density.
    rng : numpy.random.Generator
        Source of randomness.
    target_ess : int
        Effective sample size wanted.
    most : int
        Draws that may be spent, but for those that count: 2000 to 20,000 are made in any case.
    tolerated : float
        Share of a population's members beyond the weights of the heaviest draws, below which draws
        stand.
    tail : float
        Share of all mass in these heaviest draws; 0, and the heaviest alone is meant, where members
        are none of the posterior.

    Returns
    -------
    Rounds
        The last that were made where none are trusted before the draws are spent.
    """
    members = np.concatenate(populations)
    ends = np.cumsum([len(one) for one in populations])
    proposal, calls = _fitted(proposal, members, density), len(members) + _DRAWS
    none, laplace = np.empty((0, len(members))), proposal.optima.log_density(members)
    pool = Pool(members, density(members), (), (), none, laplace)
    pool = with_laws(pool, (proposal,), (_DRAWS,), density, rng)
    while True:
        excess, log_weights = np.split(pool.log_ratios, ends[-1:])
        beyond = excess > _heaviest(log_weights, tail)
        # no room for another round, or nothing that it could follow
        over = calls + _DRAWS + _LEAST > most or not np.isfinite(log_weights).any()
        settled = len(pool.laws) > _FEWEST * _LAWS and _worst(beyond, ends) < tolerated
        settled = settled and pareto_k_hat(log_weights) < MAX_SMOOTHED_K_HAT
        shares, share = shares_that_suit(pool, ends[-1]) if over or settled else (none, 0.0)
        count = int(max(_SPARE * target_ess / max(share, 1e-9), _LEAST))
        if over or (settled and count <= _MOST):
            room = _MOST if over else min(max(most - calls, _LEAST), _MOST)
            counts = min(count, room), room
            more, draws = _that_count(pool, shares, counts, target_ess, density, rng)
            calls += len(more.z)
            excess = pool.target[: ends[-1]] - mixed(pool.each[:, : ends[-1]], shares)
            heaviest = _heaviest(more.target - mixed(more.each, shares), tail)
            dissent = _worst(excess > heaviest, ends)
            found = Rounds(proposal, draws.that_count, dissent, calls, tolerated)
            if over or (found.trusted and found.draws.worth >= target_ess):
                if not found.trusted:
                    return found
                last = completed(proposal, pool.laws, found.draws)
                return dataclasses.replace(found, proposal=last)
            pool = joined(pool, more)  # they show what the laws left out
            excess, log_weights = np.split(pool.log_ratios, ends[-1:])
            beyond = excess > _heaviest(log_weights, tail)
        drawn = pool.z[ends[-1] :]
        sample = _sample(drawn, log_weights, members[beyond], len(members), rng)
        power = _WIDE[len(pool.laws) // _LAWS % len(_WIDE)]
        flatter = _flatter(log_weights, pool.target[ends[-1] :], power)
        wide = _fitted(proposal, _sample(drawn, flatter, members[:0], 1, rng), density)
        proposal = _fitted(proposal, sample, density)
        local, far = int(_LOCAL_SHARE * _DRAWS), int(_WIDE_SHARE * _DRAWS)
        laws = (proposal, wide, _around(proposal, pool.z, pool.log_ratios))
        pool = with_laws(pool, laws, (_DRAWS - local - far, far, local), density, rng)
        calls += _DRAWS


def _that_count(
    pool: Pool,
    shares: Array,
    counts: tuple[int, int],
    target_ess: int,
    density: CollapsedDensity,
    rng: np.random.Generator,
) -> tuple[Pool, WeightedDraws]:
    """Draw from the laws of a pool, which change no more, until enough draws count.

    Parameters
    ----------
    counts : (int, int)
        Draws to begin with, and at most: shares that suit the pool suit other draws less.
    """
    first, most = counts
    drawn = drawn_by(pool, shares, first, density, rng)
    while True:
        n, log_mixture = len(drawn.z), mixed(drawn.each, shares)
        draws = weighted_by(drawn.z, drawn.target, log_mixture, smooth=True)
        enough = int(n * min(_SPARE * target_ess / draws.worth, 2.0))
        hopeless = draws.k_hat >= MAX_SMOOTHED_K_HAT or enough > most
        if hopeless or draws.worth >= target_ess:
            return drawn, draws
        drawn = joined(drawn, drawn_by(pool, shares, enough - n, density, rng))


def _fitted(proposal: Proposal, sample: Array, density: CollapsedDensity) -> Proposal:
    return dataclasses.replace(proposal, transport=fit_map(sample, coordinates_of(density)))


def _flatter(log_weights: Array, target: Array, power: float) -> Array:
    """Return log weights to a power of the target, of draws with weights to itself."""
    at = np.where(np.isfinite(log_weights), target, 0.0)
    return np.asarray(log_weights + (power - 1.0) * at)


def _effective(log_weights: Array) -> float:
    """Return an effective sample size; 1 where the target is zero at every draw."""
    if not np.isfinite(log_weights).any():
        return 1.0
    weights: Array = special.softmax(log_weights)
    return 1.0 / float(np.sum(weights**2))


def _heaviest(log_weights: Array, tail: float) -> float:
    """Return the log weight above which the heaviest draws hold a share of all mass, or none."""
    finite = np.sort(log_weights[np.isfinite(log_weights)])[::-1]
    if not finite.size:
        return -math.inf
    held = np.cumsum(special.softmax(finite))
    return float(finite[np.searchsorted(held, tail)])


def _worst(beyond: NDArray[np.bool_], ends: NDArray[np.intp]) -> float:
    """Return the largest share of any population's members."""
    return max(float(part.mean()) for part in np.split(beyond, ends[:-1]))


def _sample(
    z: Array, log_weights: Array, beyond: Array, members: int, rng: np.random.Generator
) -> Array:
    """Return what the next map is fitted to: draws by flattened weights, and members beyond them.

    Members are as many as stand for their share of the populations.
    """
    finite = np.isfinite(log_weights)
    z, log_weights = z[finite], log_weights[finite]
    least: float = min(max(_LEAST_ESS, _PER_PAIR * z.shape[1] ** 2), 0.5 * len(z))

    def surplus(power: float) -> float:
        return _effective(power * log_weights) - least

    power = 1.0 if surplus(1.0) >= 0 else float(optimize.brentq(surplus, 0.0, 1.0, xtol=1e-9))
    weights = special.softmax(power * log_weights)
    drawn = z[rng.choice(len(z), size=_FITTED, p=weights)]
    return np.concatenate([drawn, np.repeat(beyond, max(round(_FITTED / members), 1), axis=0)])


def _around(proposal: Proposal, z: Array, values: Array) -> Local:
    """Return a law around the point of the highest log weight, as wide as its neighbours lie."""
    transport = proposal.transport
    if transport is None:
        raise ValueError("a proposal without a map")
    finite = np.isfinite(values)
    x, values = transport.unbend(z[finite])[0], values[finite]
    d, centre = x.shape[1], x[np.argmax(values)]
    apart = x - centre
    count = max(_NEIGHBOURS * d, round(_NEAR * len(x)))
    nearest = np.argsort(np.einsum("ni,ni->n", apart, apart))[:count]
    rows = np.sqrt(special.softmax(values[nearest]))[:, None] * apart[nearest]
    scale = math.sqrt(float(np.mean(rows**2)))
    rows = np.concatenate([rows, 1e-6 * scale * np.eye(d)])
    factor = linalg.qr(rows, mode="r")[0][:d].T
    factor = factor * np.sign(np.diagonal(factor))
    return Local(transport, Mixture(centre[None], factor[None], np.ones(1)))
