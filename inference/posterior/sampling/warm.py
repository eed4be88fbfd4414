"""A warm start: importance draws whose proposal follows them, held to what came from the prior.

Population Monte Carlo (Cappe et al. 2004): the Laplace shapes at the optima first, then a transport
map fitted to the draws so far by their weights. Draws that know only the optima cannot tell what
they miss, however even their weights: so points that came from the prior are weighed as well. Where
one lies beyond every weight that was drawn, the proposal is nearly empty at a place with mass.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.transport import fit_map

__all__ = ["MAP_SHARE", "Warm", "beyond", "warm_start"]

Array = NDArray[np.float64]

MAP_SHARE = 0.55  # of the steps that are independent jumps through a map
_ROUNDS = 3
_EVEN = 0.5  # effective share of the draws above which a proposal is not fitted anew
_FITTING_SHARE = 0.8  # of the steps: jumps that are mostly accepted forget fastest
_LEAST_SHARE = 0.25  # effective share of the draws below which walkers would jump too seldom
_LEAST_ESS = 50.0  # that a map is fitted to
_MOST_DISSENT = 0.1  # of the points from the prior beyond every weight


@dataclasses.dataclass(frozen=True, eq=False)
class Warm:
    """Where a warm start has come to.

    Attributes
    ----------
    proposal : Proposal
        The last one.
    dissent : float
        Share of the points from the prior at which the target exceeds the proposal by more than at
        any draw.
    calls : int
        Density evaluations.
    """

    proposal: Proposal
    draws: WeightedDraws
    dissent: float
    calls: int

    @property
    def fits(self) -> bool:
        """Whether walkers may start from the draws."""
        even = self.draws.ess > _LEAST_SHARE * len(self.draws.z)
        return even and self.draws.k_hat < MAX_K_HAT and not self.contradicted

    @property
    def contradicted(self) -> bool:
        """Whether the points from the prior stand where the draws say that nothing is."""
        return self.dissent >= _MOST_DISSENT


def warm_start(
    density: CollapsedDensity,
    proposal: Proposal,
    others: Array,
    rng: np.random.Generator,
    n: int,
) -> Warm:
    """Draw by importance from a proposal that is fitted to its draws until they are even.

    Parameters
    ----------
    proposal : Proposal
        Of the first draws.
    others : ndarray, shape (m, d)
        Points that came from the prior and know nothing of the proposal.
    n : int
        Draws of each round.
    """
    calls = len(others)
    for turn in range(_ROUNDS):
        draws = draw_weighted(density, proposal, rng, n)
        calls += n
        even = draws.k_hat < MAX_K_HAT and draws.ess > _EVEN * n
        if even or draws.ess < _LEAST_ESS or turn == _ROUNDS - 1:
            break
        kept = draws.z[rng.choice(n, size=n, p=draws.weights)]
        transport = fit_map(kept, coordinates_of(density))
        proposal = dataclasses.replace(proposal, transport=transport, share=MAP_SHARE)
    if draws.ess > _EVEN * n:
        proposal = dataclasses.replace(proposal, share=_FITTING_SHARE)
    return Warm(proposal, draws, beyond(density, proposal, draws, others), calls)


def beyond(
    density: CollapsedDensity, proposal: Proposal, draws: WeightedDraws, others: Array
) -> float:
    """Return the share of other points at which no draw's weight says that there may be so much.

    Parameters
    ----------
    proposal : Proposal
        That the draws came from.
    others : ndarray, shape (m, d)
        Points that came from the prior and know nothing of the proposal.
    """
    if not len(others):
        return 0.0
    most = np.max(draws.log_density - proposal.log_density(draws.z))
    return float(np.mean(density(others) - proposal.log_density(others) > most))
