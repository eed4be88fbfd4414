"""Where rounds of importance sampling stand, and what they come to."""

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import NDArray
from scipy import special

from inference.posterior.sampling.importance import (
    MAX_SMOOTHED_K_HAT,
    WeightedDraws,
    pareto_k_hat,
    weighted_by,
)
from inference.posterior.sampling.next_laws import LAWS
from inference.posterior.sampling.pool import Pool, joined
from inference.posterior.sampling.proposal import Proposal

__all__ = ["LastDraws", "Rounds", "RoundsSoFar", "Wanted", "heaviest_of", "worst"]

Array = NDArray[np.float64]

_FEWEST = 6  # rounds: before, even weights are those of draws that all leave out the same
_FEWEST_NEAR = 3  # where members are draws of nearly the target, and weights are very even
_VERY_EVEN = 0.2  # Pareto k-hat of these
_TAILS = 3  # rounds of maps behind shapes, from which on tails are in the draws
_TAIL = 0.01  # of the draws' mass, in the heaviest of them: there may be
_MOST_DISSENT = 0.03  # so many of a population's members


@dataclasses.dataclass(frozen=True)
class Wanted:
    """What rounds are to come to, and what they may take.

    Attributes
    ----------
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
    first : int
        Draws of each round until rounds tell what they left out.
    shapes : int
        Rounds, the first ones, whose only law is a shape that bends nothing and follows the draws:
        the one to begin with is brought by the proposal. 0 where a map is fitted to the members.
    near : bool
        Whether members are draws of nearly the target: then very even weights tell sooner.
    """

    target_ess: int
    most: int
    tolerated: float = _MOST_DISSENT
    tail: float = _TAIL
    first: int = 1000
    shapes: int = 0
    near: bool = False


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


@dataclasses.dataclass(frozen=True, eq=False)
class LastDraws:
    """The draws that count, while they are made: the laws change no more.

    Attributes
    ----------
    shares : ndarray, shape (laws,)
        Of the laws.
    count : int
        Draws after which they are judged: shares that suit the pool suit other draws less, and
        more are made then where these are too few.
    most : int
        Draws at most.
    last : bool
        Whether they are the end, good or not; otherwise rounds may go on.
    drawn : Pool or None
        Those that there are.
    """

    shares: Array
    count: int
    most: int
    last: bool
    drawn: Pool | None = None


@dataclasses.dataclass(frozen=True, eq=False)
class RoundsSoFar:
    """Where rounds stand between two steps.

    Attributes
    ----------
    wanted : Wanted
        What they are to come to.
    proposal : Proposal
        With the last map.
    pool : Pool
        All draws, the members of the populations first.
    ends : tuple of int
        Of the members of each population.
    calls : int
        Density evaluations.
    steps : int
        Made so far, the beginning among them.
    last : LastDraws or None
        The draws that count, while they are made.
    """

    wanted: Wanted
    proposal: Proposal
    pool: Pool
    ends: tuple[int, ...]
    calls: int
    steps: int = 1
    last: LastDraws | None = None

    @property
    def members(self) -> int:
        """How many members of populations the pool begins with."""
        return self.ends[-1]

    @property
    def open(self) -> Array:
        """Draws of the step that is being made, to be evaluated, shape (n, d)."""
        if self.last is None:
            return self.pool.open
        return self.pool.z[:0] if self.last.drawn is None else self.last.drawn.open

    @property
    def shaped(self) -> bool:
        """Whether the next law is still a shape."""
        return len(self.pool.laws) < self.wanted.shapes

    @property
    def beyond(self) -> NDArray[np.bool_]:
        """Which members lie beyond the heaviest draws, shape (members,)."""
        heaviest = heaviest_of(self.pool.log_ratios[self.members :], self.wanted.tail)
        return np.asarray(self.pool.log_ratios[: self.members] > heaviest)

    @property
    def log_weights(self) -> Array:
        """Of all draws but the members."""
        return self.pool.log_ratios[self.members :]

    @functools.cached_property
    def k_hat(self) -> float:
        """Pareto shape of these weights."""
        return pareto_k_hat(self.log_weights)

    @property
    def telling(self) -> bool:
        """Whether rounds are so many that the weights tell what was left out."""
        laws = len(self.pool.laws)
        soon = self.wanted.near and laws > _FEWEST_NEAR * LAWS and self.k_hat < _VERY_EVEN
        return soon or laws > _FEWEST * LAWS

    @property
    def draws(self) -> WeightedDraws | None:
        """All draws so far, by weight; None where they tell little, or members contradict them.

        Shapes follow the target itself, and first maps the members: behind the former few rounds
        of maps tell as much as many behind the latter. Draws of shapes alone leave out tails.
        """
        shapes = self.wanted.shapes
        early = shapes > 0 and len(self.pool.laws) >= shapes + _TAILS * LAWS
        if not (self.telling or early):
            return None
        now = self
        if self.last is not None and self.last.drawn is not None:
            now = dataclasses.replace(self, pool=joined(self.pool, self.last.drawn))
        if worst(now.beyond, self.ends) >= self.wanted.tolerated:
            return None
        pool, m = now.pool, self.members
        draws = weighted_by(pool.z[m:], pool.target[m:], pool.log_mixture[m:], smooth=True)
        return draws.that_count


def heaviest_of(log_weights: Array, tail: float) -> float:
    """Return the log weight above which the heaviest draws hold a share of all mass, or none."""
    finite = np.sort(log_weights[np.isfinite(log_weights)])[::-1]
    if not finite.size:
        return -math.inf
    held = np.cumsum(special.softmax(finite))
    return float(finite[np.searchsorted(held, tail)])


def worst(beyond: NDArray[np.bool_], ends: tuple[int, ...]) -> float:
    """Return the largest share of any population's members."""
    return max(float(part.mean()) for part in np.split(beyond, ends[:-1]))
