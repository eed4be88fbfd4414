"""Ensembles that have not moved yet, wherever they start from."""

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.answer.separation import boundaries, labels
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of
from inference.posterior.sampling.by_weight import heavy, systematic
from inference.posterior.sampling.ensemble import (
    WALKERS,
    Ensemble,
    advance,
    new_ensemble,
    restart,
    warm_walkers,
)
from inference.posterior.sampling.importance import WeightedDraws
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.stages.stage import Outset, Walking, Weighted
from inference.posterior.streams import Stream
from simulator.errors import RefusedError

__all__ = [
    "POPULATIONS",
    "answer_of",
    "are_told",
    "from_draws",
    "from_weighted",
    "new_ensembles",
    "worth_wanted",
]

Array = NDArray[np.float64]

POPULATIONS = 2  # independent of one another, so that they can disagree
_TRIES = 50  # draws of as many points as there are walkers
_ON_THE_WAY = 12  # steps: a walker where next to nothing is takes the first jump that leads away
_WALKED_FROM = 400  # effective size of the draws that walkers begin at
_IN_A_MODE = 4  # walkers that are to begin in each mode
_MANY_WALKERS = 64  # of an ensemble that begins at draws of the posterior, each a draw of its own


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


def worth_wanted(job: Job) -> int:
    """Return the effective size that weighted draws are to have: what is asked of the answer.

    Walkers that begin at them make the rest themselves, as an error of the draws is forgotten.
    """
    target = job.settings.target_ess
    return min(target, _WALKED_FROM) if job.settings.method == "emcee" else target


def are_told(job: Job, draws: WeightedDraws) -> bool:
    """Tell whether weighted draws can be the answer as they are, or walkers that begin at them.

    Of a mode that hardly any walker begins in next to nothing would be told: where one has a small
    share of the draws, ensembles walk until they have come and gone often enough.
    """
    if job.settings.method != "emcee":
        return True
    walkers = (job.settings.ensembles - 1) * _MANY_WALKERS
    carry = heavy(draws.weights)
    for column in draws.z.T:
        cuts = boundaries(column[carry])
        shares = np.bincount(labels(column, cuts), draws.weights, cuts.size + 1)
        if shares.min() * walkers < _IN_A_MODE:
            return False
    return True


def answer_of(
    job: Job, proposal: Proposal, draws: WeightedDraws, others: Array, adaptations: int
) -> Weighted:
    """Return weighted draws that could be the answer; with `emcee`, from where ensembles walk.

    Parameters
    ----------
    proposal, draws : Proposal, WeightedDraws
        Trusted, and worth what was asked for.
    others : ndarray, shape (n, d)
        Points that came from the prior and know nothing of them.
    adaptations : int
        0 where no populations were called for so far.
    """
    outset = Outset(proposal, others, adaptations) if job.settings.method == "emcee" else None
    return Weighted(proposal.optima, draws, Verdict(True, ()), outset)


def from_draws(
    job: Job, density: CollapsedDensity, draws: WeightedDraws, outset: Outset
) -> tuple[Walking, int]:
    """Set up ensembles that walk from draws that could be the answer.

    All but the last begin at draws by their weights, many at those of much weight: walkers are then
    draws of the posterior whatever few steps they make. The last begins at the other points, and
    its way from there is forgotten.

    Returns
    -------
    (Walking, int)
        And the density evaluations that it took.
    """
    proposal, count = outset.proposal, job.settings.ensembles - 1
    rng, walkers = job.stream(Stream.MEMBERS), _MANY_WALKERS
    chosen = rng.permutation(systematic(draws.weights, count * walkers, rng))
    seeds = job.seeds(Stream.ENSEMBLES)
    own = [
        new_ensemble(proposal, draws.z[some], draws.log_density[some], seed)
        for some, seed in zip(np.split(chosen, count), seeds.spawn(count), strict=True)
    ]
    (other,) = new_ensembles(density, proposal, (outset.others,), seeds, walkers)
    other = advance(density, proposal, other, _ON_THE_WAY, aliases_of(density))
    pending = Verdict(False, ("no steps were made",))
    ensembles = (*own, restart(other, proposal, proposal))
    stage = Walking(
        proposal, ensembles, pending, outset.adaptations, weighted=draws, start=draws.worth
    )
    return stage, walkers * (1 + _ON_THE_WAY)
