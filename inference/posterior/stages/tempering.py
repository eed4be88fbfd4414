"""The stage in which populations are carried from the prior to the posterior.

Those that arrived are what importance sampling in rounds begins with, and is held to. Its draws are
the answer where they may be; otherwise they say from where, and through which map, ensembles walk.
Small populations that stop on their way, and stand wider than the posterior, mostly suffice for
that, at a tenth to a third of the cost. Where they do not, rounds begin once more at what they drew
themselves; then larger populations follow, from the prior anew.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from inference.posterior.job import Job
from inference.posterior.sampling.effort import effort_of, halfway
from inference.posterior.sampling.ensemble import WALKERS, warm_walkers
from inference.posterior.sampling.flux_coordinate import coordinates_of
from inference.posterior.sampling.population import Population, first_population, temper
from inference.posterior.sampling.rounds import Rounds, in_rounds
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.ensembles import POPULATIONS, from_weighted, new_ensembles
from inference.posterior.stages.stage import Tempering, Walking, Weighted
from inference.posterior.stages.standing import best_known
from inference.posterior.streams import Stream

__all__ = [
    "HALFWAY_DRAWS",
    "SCOUTED_DRAWS",
    "TOLERATED",
    "SetOutTask",
    "TemperTask",
    "merge",
    "tasks",
]

_SHARE = 0.5  # of what the populations took, that importance sampling behind them may take
_MOST_DRAWS = (12_000, 40_000)  # but so many at least, and at most
SCOUTED_DRAWS = 20_000  # that rounds from scouts may take: as many as carry one population
HALFWAY_DRAWS = 40_000  # and those from small populations, twice: as many as carry these
_LEADING = 50.0  # effective size of draws, from which on rounds may begin again at them
TOLERATED = 0.01  # of what scouts met on their way from the prior, beyond every weight


@dataclasses.dataclass(frozen=True, eq=False)
class TemperTask:
    """Some temperatures of a population.

    Attributes
    ----------
    population : Population or None
        None before it is drawn from the prior.
    index : int
        Of the population.
    calls : int
        Density evaluations after which to stop.
    reach : float
        Power of the likelihood at which to stop.
    """

    job: Job
    population: Population | None
    index: int
    calls: int
    reach: float

    def run(self) -> Population:
        """Carry the population on."""
        density, population = self.job.density(), self.population
        effort = effort_of(density) if self.reach == 1.0 else halfway(density)
        before = 0 if population is None else population.calls
        if population is None:
            population = first_population(density, self._stream(0), effort)
        while not population.ended and population.power < self.reach:
            if population.calls - before >= self.calls:
                break
            stream = self._stream(1 + population.steps)
            population = temper(density, population, stream, effort)
        return population

    def _stream(self, temperature: int) -> np.random.Generator:
        index = self.index if self.reach == 1.0 else POPULATIONS + self.index
        return self.job.stream(Stream.POPULATIONS, index, temperature)


@dataclasses.dataclass(frozen=True, eq=False)
class SetOutTask:
    """Importance sampling from populations that arrived, and what comes of it.

    Attributes
    ----------
    stage : Tempering
        With populations of which at least one has arrived.
    """

    job: Job
    stage: Tempering

    def run(self) -> Checkpoint:
        """Return the answer, or ensembles that set out."""
        after, calls = _set_out(self.job, self.stage)
        return Checkpoint(after, calls, None, self.job.representatives)


def tasks(job: Job, stage: Tempering) -> tuple[TemperTask | SetOutTask, ...]:
    """Return the populations that are still on their way; behind them what comes of them."""
    if stage.arrived:
        return (SetOutTask(job, stage),)
    return tuple(
        TemperTask(job, population, k, evaluations(job), stage.reach)
        for k, population in enumerate(stage.populations)
        if not stage.has_come(population)
    )


def merge(
    job: Job, stage: Tempering, carried: Sequence[Population]
) -> tuple[Tempering | Walking, int]:
    """Take in populations; set up ensembles where all died on the way.

    Parameters
    ----------
    carried : sequence of Population
        In the order of `tasks`.

    Returns
    -------
    (Tempering or Walking, int)
        The next stage, and the density evaluations on the way to it.
    """
    calls, found, rest = 0, [], iter(carried)
    for old in stage.populations:
        if old is not None and stage.has_come(old):
            found.append(old)
            continue
        new = next(rest)
        calls += new.calls - (0 if old is None else old.calls)
        found.append(new)
    stage = dataclasses.replace(stage, populations=tuple(found))
    if any(len(population.z) or not population.ended for population in found):
        return stage, calls
    if stage.early:
        return _all_the_way(stage), calls
    walking = _walking(job, stage, [], None)
    return walking, calls + WALKERS * len(walking.ensembles)


def _set_out(job: Job, stage: Tempering) -> tuple[Tempering | Weighted | Walking, int]:
    """Sample by importance from the populations that arrived; set up ensembles where it fails."""
    members = [each for each in stage.populations if each is not None and len(each.z)]
    found, auto = _in_rounds(job, stage, members), job.settings.method == "auto"
    if auto and found.trusted and found.draws.worth >= job.settings.target_ess:
        return Weighted(found.proposal.optima, found.draws, Verdict(True, ())), found.calls
    if not stage.early:
        walking = _walking(job, stage, members, found)
    elif _may_try_again(stage, found) and (auto or not found.trusted):
        # in a chunk of its own: a job may be out of time by now
        return dataclasses.replace(stage, weighted=found.draws, tried=True), found.calls
    elif found.trusted and not auto:
        density, others = job.density(), members[0].z
        ensembles = from_weighted(job, density, found.proposal, found.draws, others)
        walking = Walking(found.proposal, ensembles, stage.verdict, 2, weighted=found.draws)
    else:
        # until larger populations are on their way an answer is made of what there is
        if found.dissent < TOLERATED:
            stage = dataclasses.replace(stage, weighted=found.draws)
        known = best_known(stage)
        stage = dataclasses.replace(stage, weighted=None if known is None else known[0])
        return _all_the_way(stage), found.calls
    return walking, found.calls + walking.ensembles[0].walkers * len(walking.ensembles)


def _in_rounds(job: Job, stage: Tempering, members: Sequence[Population]) -> Rounds:
    """Sample by importance from the populations, and from what was drawn before."""
    density, target, early = job.density(), job.settings.target_ess, (TOLERATED, 0.0)
    proposal = dataclasses.replace(stage.proposal, share=MAP_SHARE)
    populations = tuple(each.z for each in members)
    if stage.scouted:
        rng = job.stream(Stream.ROUNDS, 0)
        return in_rounds(density, proposal, populations, rng, target, SCOUTED_DRAWS, *early)
    if stage.early:
        rng = job.stream(Stream.ROUNDS, 1 + stage.tried)
        if stage.tried and stage.weighted is not None:
            drawn = stage.weighted
            some = rng.choice(len(drawn.z), size=len(populations[0]), p=drawn.weights)
            populations = (*populations, drawn.z[some])
        return in_rounds(density, proposal, populations, rng, target, HALFWAY_DRAWS, *early)
    most = int(np.clip(_SHARE * sum(each.calls for each in members), *_MOST_DRAWS))
    return in_rounds(density, proposal, populations, job.stream(Stream.ROUNDS), target, most)


def _may_try_again(stage: Tempering, found: Rounds) -> bool:
    """Tell whether rounds have come so far that they may begin again where they are."""
    first = not (stage.scouted or stage.tried)
    return first and found.dissent < TOLERATED and found.draws.ess >= _LEADING


def _all_the_way(stage: Tempering) -> Tempering:
    """Return the stage in which larger populations set out from the prior."""
    return dataclasses.replace(stage, populations=(None,) * POPULATIONS, scouted=False, reach=1.0)


def _walking(
    job: Job, stage: Tempering, arrived: list[Population], found: Rounds | None
) -> Walking:
    """Set up ensembles in the coordinates of the best map that there is.

    The last ensemble starts around the optima of the multistart, the others from populations that
    came from the prior and know nothing of them: they can contradict one another.
    """
    proposal, density = stage.proposal, job.density()
    count = job.settings.ensembles
    starts = [np.empty((0, len(density.parameters)))] * count
    if arrived:
        members = [population.z for population in arrived]
        transport = fit_map(np.concatenate(members), coordinates_of(density))
        proposal = dataclasses.replace(proposal, transport=transport, share=MAP_SHARE)
        orders = [job.stream(Stream.MEMBERS, k).permutation(len(z)) for k, z in enumerate(members)]
        sharing = -(-(count - 1) // len(members))
        for k in range(count - 1):
            # ensembles that share a population begin in parts of their own
            turn, which = divmod(k, len(members))
            order = np.roll(orders[which], -(turn * len(members[which]) // sharing))
            starts[k] = members[which][order]
    trusted = found is not None and found.trusted
    if found is not None and trusted:
        proposal = found.proposal
    walkers = warm_walkers(len(density.parameters)) if trusted else WALKERS
    seeds = job.seeds(Stream.ENSEMBLES)
    ensembles = new_ensembles(density, proposal, tuple(starts), seeds, walkers)
    weighted = found.draws if found is not None and trusted else None
    # a law that was held to weighted draws is left for one fitted to walkers only where these stay
    adaptations = 2 if trusted else 1
    return Walking(proposal, ensembles, stage.verdict, adaptations, weighted=weighted)
