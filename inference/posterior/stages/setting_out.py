"""What comes of populations that arrived: rounds of importance draws, and what these lead to.

Rounds begin at the members, and are made in chunks of some steps each. Their draws are the answer
where they may be; otherwise they say from where, and through which map, ensembles walk. Rounds from
small populations that fail begin once more at what they drew themselves; then larger populations
follow, from the prior anew.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.job import Job
from inference.posterior.sampling.coordinates import coordinates_of
from inference.posterior.sampling.ensemble import WALKERS, warm_walkers
from inference.posterior.sampling.population import Population
from inference.posterior.sampling.rounds import STEP, first_draws, next_draws, taken_in
from inference.posterior.sampling.rounds_so_far import Rounds, RoundsSoFar, Wanted
from inference.posterior.sampling.transport import fit_map
from inference.posterior.sampling.warm import MAP_SHARE
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.ensembles import (
    POPULATIONS,
    answer_of,
    are_told,
    from_weighted,
    new_ensembles,
    worth_wanted,
)
from inference.posterior.stages.stage import Tempering, Walking, Weighted
from inference.posterior.stages.standing import best_known
from inference.posterior.streams import Stream

__all__ = [
    "HALFWAY",
    "HALFWAY_DRAWS",
    "SCOUTED_DRAWS",
    "TOLERATED",
    "EvaluateTask",
    "Evaluated",
    "SetOutTask",
    "all_the_way",
    "put_together",
    "small_populations",
    "walking_from",
]

Array = NDArray[np.float64]

HALFWAY = 0.3  # power of the likelihood at which small populations stop, and scouts before shapes
_SHARE = 0.5  # of what the populations took, that importance sampling behind them may take
_MOST_DRAWS = (12_000, 40_000)  # but so many at least, and at most
SCOUTED_DRAWS = 20_000  # that rounds from scouts may take: as many as carry one population
HALFWAY_DRAWS = 40_000  # and those from small populations, twice: as many as carry these
# draws of a round until rounds tell, where that is dear or what begins it lies near: a fifth less
# in all than with twice as many
_FIRST = 500
_SHAPES = 4  # rounds of shapes, where rounds begin with one
_FITTED = 2  # adaptations of a law that was held to weighted draws
_LEADING = 50.0  # effective size of draws, from which on rounds may begin again at them
_ERRING = 4  # number of the streams of rounds with errors of the model integrated out, the first
TOLERATED = 0.01  # of what scouts met on their way from the prior, beyond every weight


@dataclasses.dataclass(frozen=True, eq=False)
class SetOutTask:
    """Some steps of importance sampling from populations that arrived; at the end what they led to.

    Attributes
    ----------
    stage : Tempering
        With populations of which at least one has arrived, and with rounds where some were made.
    calls : int
        Density evaluations after which to stop.
    """

    job: Job
    stage: Tempering
    calls: int

    def run(self) -> Checkpoint:
        """Return where rounds stand; at their end the answer, or ensembles that set out."""
        job, stage, density = self.job, self.stage, self.job.density()
        before = 0 if stage.rounds is None else stage.rounds.calls
        reached = self._next(density, stage.rounds)
        while isinstance(reached, RoundsSoFar) and reached.calls - before < self.calls:
            reached = self._next(density, reached)
        return _led_to(job, stage, reached)

    def _next(self, density: CollapsedDensity, so_far: RoundsSoFar | None) -> RoundsSoFar | Rounds:
        drawn = _drawn(self.job, self.stage, density, so_far)
        return taken_in(drawn, density(drawn.open))


@dataclasses.dataclass(frozen=True, eq=False)
class Evaluated:
    """Some of the draws of a step, evaluated.

    Attributes
    ----------
    drawn : RoundsSoFar or None
        With all draws of the step, of the first part alone.
    values : ndarray, shape (m,)
        Log density of the part's.
    """

    drawn: RoundsSoFar | None
    values: Array


@dataclasses.dataclass(frozen=True, eq=False)
class EvaluateTask:
    """A part of the draws of one step to be evaluated, where that takes long.

    Every part makes all draws, which takes little, and evaluates its own.

    Attributes
    ----------
    job, stage : Job, Tempering
        As of `SetOutTask`.
    part, parts : int
        Which of how many.
    """

    job: Job
    stage: Tempering
    part: int
    parts: int

    def run(self) -> Evaluated:
        """Evaluate them."""
        density = self.job.density()
        drawn = _drawn(self.job, self.stage, density, self.stage.rounds)
        own = np.array_split(drawn.open, self.parts)[self.part]
        return Evaluated(drawn if self.part == 0 else None, density(own))


def put_together(job: Job, stage: Tempering, parts: Sequence[Evaluated]) -> Checkpoint:
    """Return what a step led to, as `SetOutTask`, from its parts in their order."""
    drawn = parts[0].drawn
    if drawn is None:
        raise ValueError("the first part of a step comes first")
    return _led_to(job, stage, taken_in(drawn, np.concatenate([each.values for each in parts])))


def _members(stage: Tempering) -> list[Population]:
    return [each for each in stage.populations if each is not None and len(each.z)]


def _drawn(
    job: Job, stage: Tempering, density: CollapsedDensity, so_far: RoundsSoFar | None
) -> RoundsSoFar:
    """Make the draws of the next step; the first begins rounds at what was drawn before."""
    if so_far is not None:
        return next_draws(density, so_far, _stream(job, stage, so_far.steps))
    members, rng = _members(stage), _stream(job, stage, 0)
    populations = tuple(each.z for each in members)
    if stage.tried and stage.early and stage.weighted is not None:
        drawn = stage.weighted
        some = rng.choice(len(drawn.z), size=len(populations[0]), p=drawn.weights)
        populations = (*populations, drawn.z[some])
    proposal = dataclasses.replace(stage.proposal, share=MAP_SHARE)
    return first_draws(density, proposal, populations, rng, _wanted(job, stage, members))


def _stream(job: Job, stage: Tempering, steps: int) -> np.random.Generator:
    """Return the stream of a step: rounds that a job begins in turn have their own."""
    which = 0 if stage.scouted else 1 + stage.tried if stage.early else 3
    # they may follow those of an exact model
    which += _ERRING if job.scene.model_error.integrated else 0
    return job.stream(Stream.ROUNDS, which, steps)


def _led_to(job: Job, stage: Tempering, reached: RoundsSoFar | Rounds) -> Checkpoint:
    """Return where rounds stand; at their end the answer, or ensembles that set out."""
    before = 0 if stage.rounds is None else stage.rounds.calls
    after: Tempering | Weighted | Walking
    if isinstance(reached, RoundsSoFar):
        after, calls = dataclasses.replace(stage, rounds=reached), reached.calls
    else:
        begun = dataclasses.replace(stage, rounds=None)
        after, calls = _set_out(job, begun, _members(stage), reached)
    return Checkpoint(after, calls - before, None, job.representatives)


def _wanted(job: Job, stage: Tempering, members: Sequence[Population]) -> Wanted:
    """Return what rounds are to come to: populations that stop on their way are held to more."""
    target = worth_wanted(job)
    if stage.early:
        far = stage.shaped or not stage.scouted
        most = HALFWAY_DRAWS if far else SCOUTED_DRAWS
        few = stage.shaped or stage.scouted or job.scene.model_error.integrated
        first = _FIRST if few else STEP
        shapes = _SHAPES if stage.shaped else 0
        return Wanted(target, most, TOLERATED, 0.0, first, shapes, stage.near)
    most = int(np.clip(_SHARE * sum(each.calls for each in members), *_MOST_DRAWS))
    return Wanted(target, most)


def _set_out(
    job: Job, stage: Tempering, members: list[Population], found: Rounds
) -> tuple[Tempering | Weighted | Walking, int]:
    """Answer by the draws of rounds; set up ensembles, or begin again, where they fail."""
    enough = found.trusted and found.draws.worth >= worth_wanted(job)
    if enough and are_told(job, found.draws):
        others = members[0].z
        return answer_of(job, found.proposal, found.draws, others, _FITTED), found.calls
    if not stage.early:
        walking = walking_from(job, stage, members, found)
    elif enough:
        density, others = job.density(), members[0].z
        ensembles = from_weighted(job, density, found.proposal, found.draws, others)
        walking = Walking(found.proposal, ensembles, stage.verdict, _FITTED, weighted=found.draws)
    elif _may_try_again(stage, found):
        # in a chunk of its own: a job may be out of time by now
        return dataclasses.replace(stage, weighted=found.draws, tried=True), found.calls
    elif stage.shaped:
        return small_populations(stage), found.calls
    else:
        # until larger populations are on their way an answer is made of what there is
        if found.dissent < TOLERATED:
            stage = dataclasses.replace(stage, weighted=found.draws)
        known = best_known(stage)
        stage = dataclasses.replace(stage, weighted=None if known is None else known[0])
        return all_the_way(stage), found.calls
    return walking, found.calls + walking.ensembles[0].walkers * len(walking.ensembles)


def _may_try_again(stage: Tempering, found: Rounds) -> bool:
    """Tell whether rounds have come so far that they may begin again where they are."""
    first = not (stage.scouted or stage.tried)
    return first and found.dissent < TOLERATED and found.draws.ess >= _LEADING


def small_populations(stage: Tempering) -> Tempering:
    """Return the stage in which small populations set out from the prior, and stop on their way."""
    proposal = dataclasses.replace(stage.proposal, transport=None)
    populations = (None,) * POPULATIONS
    return Tempering(proposal, populations, stage.verdict, stage.weighted, reach=HALFWAY)


def all_the_way(stage: Tempering) -> Tempering:
    """Return the stage in which larger populations set out from the prior."""
    return dataclasses.replace(stage, populations=(None,) * POPULATIONS, scouted=False, reach=1.0)


def walking_from(
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
    adaptations = _FITTED if trusted else 1
    return Walking(proposal, ensembles, stage.verdict, adaptations, weighted=weighted)
