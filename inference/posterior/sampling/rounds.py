"""Importance sampling in rounds: every proposal is fitted to the draws of all rounds before it.

Adaptive multiple importance sampling (Cornuet et al. 2012): a draw of any round is weighted by the
mixture of all proposals (Owen and Zhou 2000), so that what one of them leaves out another holds.
Members of populations that came from the prior begin it, and are what it is held to. The draws that
count are made at the end, from proposals that are fitted no more. Rounds are made step by step, and
may be put aside between two of them. Draws of a step are made first and evaluated then, by whoever
has the time: that is most of what it takes.
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.sampling.importance import (
    MAX_SMOOTHED_K_HAT,
    log_ratio,
    weighted_by,
)
from inference.posterior.sampling.next_laws import fitted, next_laws, next_shape
from inference.posterior.sampling.pool import (
    Pool,
    drawn_by,
    joined,
    mixed,
    shares_that_suit,
    with_laws,
)
from inference.posterior.sampling.proposal import Proposal, completed
from inference.posterior.sampling.rounds_so_far import (
    LastDraws,
    Rounds,
    RoundsSoFar,
    Wanted,
    heaviest_of,
    worst,
)

__all__ = ["STEP", "first_draws", "in_rounds", "next_draws", "taken_in"]

Array = NDArray[np.float64]

STEP = 1000  # draws: of a round once rounds tell, or some of those that count
_LOCAL_SHARE = 0.25  # of a round's, from around the place that the others hold least of
_WIDE_SHARE = 0.35  # of them, from the wider map
_LEAST = 2000  # draws that count: the shape of their weights' tail is known to 0.13
_MOST = 20_000  # of them
_SPARE = 1.3  # times the draws that are foreseen


def in_rounds(
    density: CollapsedDensity,
    proposal: Proposal,
    populations: tuple[Array, ...],
    rng: np.random.Generator,
    wanted: Wanted,
) -> Rounds:
    """Draw by importance, in rounds that follow what was drawn, to the end.

    Parameters
    ----------
    density, proposal, populations, wanted : CollapsedDensity, Proposal, tuple of ndarray, Wanted
        As of `first_draws`.
    rng : numpy.random.Generator
        Source of randomness of all steps.

    Returns
    -------
    Rounds
        The last that were made where none are trusted before the draws are spent.
    """
    drawn = first_draws(density, proposal, populations, rng, wanted)
    reached = taken_in(drawn, density(drawn.open))
    while isinstance(reached, RoundsSoFar):
        drawn = next_draws(density, reached, rng)
        reached = taken_in(drawn, density(drawn.open))
    return reached


def first_draws(
    density: CollapsedDensity,
    proposal: Proposal,
    populations: tuple[Array, ...],
    rng: np.random.Generator,
    wanted: Wanted,
) -> RoundsSoFar:
    """Begin rounds with a map that is fitted to members of populations, or with a shape.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    proposal : Proposal
        With the optima that are known, and the shape where one is wanted.
    populations : tuple of ndarray, shape (m, d) each
        Members of populations that came from the prior, of finite density.
    rng : numpy.random.Generator
        Source of randomness of the first draws.
    wanted : Wanted
        What the rounds are to come to.

    Returns
    -------
    RoundsSoFar
        Whose ``open`` draws, the members among them, are to be evaluated.
    """
    members = np.concatenate(populations)
    ends = np.cumsum([len(one) for one in populations]).tolist()
    if not wanted.shapes:
        proposal = fitted(proposal, members, density)
    pool = Pool(members, np.empty(0), (), (), (), proposal.optima.log_density(members))
    pool = with_laws(pool, (proposal,), (wanted.first,), rng)
    return RoundsSoFar(wanted, proposal, pool, tuple(ends), 0)


def next_draws(
    density: CollapsedDensity, so_far: RoundsSoFar, rng: np.random.Generator
) -> RoundsSoFar:
    """Make the draws of one round, or some of those that count: `STEP`, or fewer.

    Parameters
    ----------
    density : CollapsedDensity
        Target.
    so_far : RoundsSoFar
        From `taken_in`.
    rng : numpy.random.Generator
        Source of randomness of this step.

    Returns
    -------
    RoundsSoFar
        Whose ``open`` draws are to be evaluated.
    """
    so_far = dataclasses.replace(so_far, steps=so_far.steps + 1)
    last = so_far.last
    if last is not None:
        made = 0 if last.drawn is None else len(last.drawn.z)
        drawn = drawn_by(so_far.pool, last.shares, min(last.count - made, STEP), rng)
        drawn = drawn if last.drawn is None else joined(last.drawn, drawn)
        return dataclasses.replace(so_far, last=dataclasses.replace(last, drawn=drawn))
    if so_far.shaped:
        proposal = next_shape(so_far.proposal, so_far.pool, so_far.members)
        pool = with_laws(so_far.pool, (proposal,), (so_far.wanted.first,), rng)
        return dataclasses.replace(so_far, proposal=proposal, pool=pool)
    laws = next_laws(density, so_far.proposal, so_far.pool, so_far.beyond, rng)
    size = STEP if so_far.telling else so_far.wanted.first
    local, far = int(_LOCAL_SHARE * size), int(_WIDE_SHARE * size)
    pool = with_laws(so_far.pool, laws, (size - local - far, far, local), rng)
    return dataclasses.replace(so_far, proposal=laws[0], pool=pool)


def taken_in(so_far: RoundsSoFar, values: Array) -> RoundsSoFar | Rounds:
    """Take in the log density of the draws that were open, and judge all.

    Parameters
    ----------
    so_far : RoundsSoFar
        From `first_draws` or `next_draws`.
    values : ndarray, shape (n,)
        Of its ``open`` draws.

    Returns
    -------
    RoundsSoFar or Rounds
        Rounds where no step is left.
    """
    so_far = dataclasses.replace(so_far, calls=so_far.calls + len(values))
    last = so_far.last
    if last is None or last.drawn is None:
        return _judged(dataclasses.replace(so_far, pool=so_far.pool.evaluated(values)))
    return _counted(so_far, dataclasses.replace(last, drawn=last.drawn.evaluated(values)))


def _judged(so_far: RoundsSoFar) -> RoundsSoFar:
    """Have the draws that count made next, where the laws seem to hold all or no round is left."""
    pool, wanted, calls = so_far.pool, so_far.wanted, so_far.calls
    # no room for another round, or nothing that it could follow
    over = calls + STEP + _LEAST > wanted.most or not np.isfinite(so_far.log_weights).any()
    settled = so_far.telling and worst(so_far.beyond, so_far.ends) < wanted.tolerated
    settled = settled and so_far.k_hat < MAX_SMOOTHED_K_HAT
    if not (over or settled):
        return so_far
    shares, share = shares_that_suit(pool, so_far.members)
    count = int(max(_SPARE * wanted.target_ess / max(share, 1e-9), _LEAST))
    if count > _MOST and not over:
        return so_far
    room = _MOST if over else min(max(wanted.most - calls, _LEAST), _MOST)
    return dataclasses.replace(so_far, last=LastDraws(shares, min(count, room), room, over))


def _counted(so_far: RoundsSoFar, last: LastDraws) -> RoundsSoFar | Rounds:
    """Judge the draws that count, where these are all."""
    wanted, drawn = so_far.wanted, last.drawn
    if drawn is not None and len(drawn.z) == last.count:
        log_mixture = mixed(drawn.each, last.shares)
        draws = weighted_by(drawn.z, drawn.target, log_mixture, smooth=True)
        enough = int(last.count * min(_SPARE * wanted.target_ess / draws.worth, 2.0))
        hopeless = draws.k_hat >= MAX_SMOOTHED_K_HAT or enough > last.most
        if hopeless or draws.worth >= wanted.target_ess:
            dissent = _dissent(so_far, log_ratio(drawn.target, log_mixture), last.shares)
            found = Rounds(
                so_far.proposal, draws.that_count, dissent, so_far.calls, wanted.tolerated
            )
            return _ended(so_far, last, drawn, found)
        last = dataclasses.replace(last, count=enough)
    return dataclasses.replace(so_far, last=last)


def _ended(
    so_far: RoundsSoFar, last: LastDraws, drawn: Pool, found: Rounds
) -> RoundsSoFar | Rounds:
    """Return what the draws that count came to, or have rounds go on with them among the others."""
    enough = found.trusted and found.draws.worth >= so_far.wanted.target_ess
    if not (last.last or enough):
        pool = joined(so_far.pool, drawn)  # they show what the laws left out
        return dataclasses.replace(so_far, pool=pool, last=None)
    if not found.trusted:
        return found
    proposal = completed(so_far.proposal, so_far.pool.laws, found.draws)
    return dataclasses.replace(found, proposal=proposal)


def _dissent(so_far: RoundsSoFar, log_weights: Array, shares: Array) -> float:
    """Return the largest share of a population's members beyond the draws that count."""
    pool, members = so_far.pool, so_far.members
    excess = pool.target[:members] - mixed([one[:members] for one in pool.each], shares)
    return worst(excess > heaviest_of(log_weights, so_far.wanted.tail), so_far.ends)
