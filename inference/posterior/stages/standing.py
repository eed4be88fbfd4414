"""What stands as an answer while populations and ensembles are on their way: weighted draws.

Members of a population at some temperature are draws of the posterior by weight, whose tail is
smoothed by a Pareto law (Vehtari et al. 2024). Copies of a member say as much as one of them, so
that the effective sample size counts each place once. Where the shape of the tail says that the
weights cannot be trusted, or a few places are all there is, nothing stands. Draws of rounds that go
on stand before what these began at, where there are enough rounds and the populations agree.
"""

import dataclasses
import math

import numpy as np
import scipy

from inference.posterior.sampling.importance import (
    MAX_SMOOTHED_K_HAT,
    WeightedDraws,
    smoothed,
)
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.stages.stage import Drawing, Stage, Tempering, Walking, Weighted

__all__ = ["best_known", "standing", "stands"]


_LEAST_ESS = 50.0  # below it, quantiles of 5 and 95 % are those of two or three draws
_LEAST_STEPS = 4  # of ensembles, from which on they speak for themselves


def standing(stage: Drawing) -> Drawing:
    """Return what an answer is made of where a job stops at some stage.

    Returns
    -------
    Drawing
        `Weighted` where nothing was drawn yet and weighted draws can be trusted; otherwise the
        stage, with a verdict that says what is wanting.
    """
    if isinstance(stage, Weighted) and stage.outset is not None:  # ensembles are still to walk
        pending = Verdict(False, ("no steps were made",))
        stage = Tempering(stage.outset.proposal, (), pending, stage.draws)
    if not isinstance(stage, Tempering | Walking):
        return stage
    if isinstance(stage, Walking) and stage.steps >= _LEAST_STEPS:
        return stage
    found = best_known(stage)
    if found is None:
        return stage
    draws, what = found
    said = f"{what}: effective sample size {draws.worth:.0f}, {_tail(draws.k_hat)}"
    if not _trusted(draws):
        reasons = (*stage.verdict.reasons, f"there are {said}: too few, or not to be trusted")
        return dataclasses.replace(stage, verdict=Verdict(False, reasons))
    verdict = Verdict(False, (f"no ensemble has walked yet: the answer is made of {said}",))
    return Weighted(stage.proposal.optima, draws, verdict)


def stands(stage: Stage) -> bool:
    """Tell whether a stage on its way has weighted draws that can be trusted."""
    found = best_known(stage) if isinstance(stage, Tempering | Walking) else None
    return found is not None and _trusted(found[0])


def best_known(stage: Tempering | Walking) -> tuple[WeightedDraws, str] | None:
    """Return the largest number of weighted draws that there are, trusted ones first; or None.

    Those of rounds that go on, if they are trusted, stand before what these began at and hold them
    to: members that stayed where there is little mass have even weights.

    Returns
    -------
    (WeightedDraws, str)
        And what they are.
    """
    found = [(stage.weighted, "importance draws")]
    if isinstance(stage, Tempering):
        drawn = None if stage.rounds is None else stage.rounds.draws
        found.append((drawn, "importance draws of rounds that were not ended"))
        if drawn is not None and _trusted(drawn):
            return drawn, found[-1][1]
        members = _of_populations(stage.populations)
        found.append((members, "weighted members of populations on their way"))
    known = [(draws, what) for draws, what in found if draws is not None]
    return max(known, key=lambda each: (_trusted(each[0]), each[0].worth), default=None)


def _tail(k_hat: float) -> str:
    """Say how heavy the tail of weights is."""
    if math.isinf(k_hat):
        return "weights too few to be trusted" if k_hat > 0 else "weights without a tail"
    return f"Pareto k-hat {k_hat:.2f}"


def _trusted(draws: WeightedDraws) -> bool:
    return draws.k_hat <= MAX_SMOOTHED_K_HAT and draws.worth >= _LEAST_ESS


def _of_populations(populations: tuple[Population | None, ...]) -> WeightedDraws | None:
    """Return the members of all populations, each population by its effective sample size."""
    found = [_weighted(each) for each in populations if each is not None and each.steps]
    if not found:
        return None
    sizes = np.array([each.ess for each in found])
    shares = sizes / sizes.sum()
    return WeightedDraws(
        np.concatenate([each.z for each in found]),
        np.concatenate([each.log_density for each in found]),
        np.concatenate([share * each.weights for share, each in zip(shares, found, strict=True)]),
        max(each.k_hat for each in found),
        float(shares @ [each.log_evidence for each in found]),
    )


def _weighted(population: Population) -> WeightedDraws:
    """Return the places of a population's members, weighted from its power to the posterior."""
    _, first, copies = np.unique(population.z, axis=0, return_index=True, return_counts=True)
    likelihood = population.log_likelihood[first]
    rest = (1.0 - population.power) * likelihood
    log_weights, k_hat = smoothed(rest)
    log_weights = log_weights + np.log(copies)
    total = float(scipy.special.logsumexp(log_weights))
    return WeightedDraws(
        population.z[first],
        likelihood + population.log_prior[first],
        np.exp(log_weights - total),
        k_hat,
        population.log_evidence + total - float(np.log(copies.sum())),
    )
