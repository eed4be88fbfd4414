"""Ensembles that have not moved yet, wherever they start from."""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job
from inference.posterior.sampling.ensemble import WALKERS, Ensemble, new_ensemble, warm_walkers
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.streams import Stream
from simulator.errors import RefusedError

__all__ = ["POPULATIONS", "from_weighted", "new_ensembles"]

Array = NDArray[np.float64]

POPULATIONS = 2  # independent of one another, so that they can disagree
_TRIES = 50  # draws of as many points as there are walkers


def new_ensembles(
    density: CollapsedDensity,
    proposal: Proposal,
    starts: tuple[Array, ...],
    seeds: np.random.SeedSequence,
    walkers: int = WALKERS,
) -> tuple[Ensemble, ...]:
    """Set up ensembles that have not moved yet.

    Parameters
    ----------
    proposal : Proposal
        In whose coordinates they walk; points that are wanting are drawn around its optima.
    starts : tuple of ndarray, shape (n, d) each
        Starting points of every ensemble, of which the first `walkers` count.
    seeds : numpy.random.SeedSequence
        Of which every ensemble gets one.
    walkers : int
        Of every ensemble.

    Raises
    ------
    RefusedError
        Where the prior leaves no room around its best parameters.
    """
    ensembles = []
    for given, seed in zip(starts, seeds.spawn(len(starts)), strict=True):
        _, first = np.unique(given, axis=0, return_index=True)
        coords = given[np.sort(first)][:walkers]
        # of no points at all, numpy before 2.4.5 cannot tell a rank
        if coords.size and np.linalg.matrix_rank(coords - coords[:1]) < coords.shape[1]:
            coords = coords[:0]  # walkers on a plane never leave it
        rng = np.random.default_rng(seed.spawn(1)[0])
        log_prob = density(coords) if len(coords) else np.empty(0)
        for _ in range(_TRIES):
            if len(coords) >= walkers:
                break
            more = proposal.optima.draw(rng, walkers)
            found = density(more)
            coords = np.concatenate([coords, more[np.isfinite(found)]])
            log_prob = np.concatenate([log_prob, found[np.isfinite(found)]])
        if len(coords) < walkers:
            raise RefusedError("the prior leaves no room around its best parameters")
        ensembles.append(new_ensemble(proposal, coords[:walkers], log_prob[:walkers], seed))
    return tuple(ensembles)


def from_weighted(
    job: Job, density: CollapsedDensity, proposal: Proposal, draws: WeightedDraws, others: Array
) -> tuple[Ensemble, ...]:
    """Start the last ensemble from other points, the rest from different weighted draws.

    Parameters
    ----------
    others : ndarray, shape (n, d)
        Points that came from the prior and know nothing of the draws.
    """
    count = job.settings.ensembles - 1
    rng, walkers = job.stream(Stream.MEMBERS), warm_walkers(len(density.parameters))
    most = min(walkers * count, int(np.count_nonzero(draws.weights)))
    order = rng.choice(len(draws.z), size=most, replace=False, p=draws.weights)
    starts = tuple(draws.z[order[k::count]] for k in range(count))
    seeds = job.seeds(Stream.ENSEMBLES)
    return new_ensembles(density, proposal, (*starts, others), seeds, walkers)
