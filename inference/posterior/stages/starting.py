"""How sampling starts: the optima that matter, a first trial of their shape, what that leads to."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.checks import check_best_fit, check_ranges
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of, with_aliases
from inference.posterior.sampling.from_the_prior import at_rest, drawn_from_the_prior
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.represent import represent
from inference.posterior.sampling.scouts import Scouts, led_to, send_scouts, thinned
from inference.posterior.sampling.start import Optimum, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import Warm, beyond, warm_start
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.ensembles import (
    POPULATIONS,
    answer_of,
    are_told,
    from_weighted,
    worth_wanted,
)
from inference.posterior.stages.integrating import at_once
from inference.posterior.stages.looking import (
    Looked,
    LookTask,
    ShapeTask,
    looking,
    of_some_frames,
    taken_in,
)
from inference.posterior.stages.optima import depend_on_errors, that_matter
from inference.posterior.stages.scouting import from_scouts
from inference.posterior.stages.setting_out import TOLERATED
from inference.posterior.stages.shaping import begins_with_a_shape, from_shapes
from inference.posterior.stages.stage import (
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from inference.posterior.streams import Stream
from simulator.errors import RefusedError

__all__ = ["StartTask", "begin", "tasks"]

Array = NDArray[np.float64]

_IMPORTANCE_DRAWS = 2000
_MOST_IMPORTANCE_DRAWS = 200_000
_MOST_IMPORTANCE_FRAMES = 8_000_000  # draws times frames: ten seconds that nothing interrupts
_WARM_DRAWS = (400, 1000)  # fewest and most: a quarter of a second of them
_SHARE = 0.5  # of an ensemble's steps that are independent jumps


@dataclasses.dataclass(frozen=True, eq=False)
class StartTask:
    """The start of sampling, behind the search for optima.

    Attributes
    ----------
    job : Job
        Without optional terms.
    stage : Starting
        What was found; nothing where nothing is unknown.
    """

    job: Job
    stage: Starting

    def run(self) -> Checkpoint:
        """Return the first stage of sampling, and the density evaluations that it took.

        Raises
        ------
        RefusedError
            Where no parameters explain the frames at all, or importance sampling alone was asked
            for and cannot be trusted.
        """
        job, stage = self.job, self.stage
        if stage.scouts is None:
            return _settled(job)
        some = of_some_frames(job) if job.is_large else job
        return _set_out(job, some.density(), stage, stage.scouts)


def tasks(job: Job, stage: Starting) -> tuple[LookTask | ShapeTask, ...] | tuple[StartTask, ...]:
    """Return the ways in which optima are still looked for; then the start.

    Parameters
    ----------
    job : Job
        Without optional terms.
    stage : Starting
        What was found before.
    """
    unknown = len(job.density().parameters) > 0
    left = looking(job, stage, scouts=True) if unknown else ()
    return left or (StartTask(job, stage),)


def begin(job: Job, stage: Starting) -> Checkpoint:
    """Find the optima, and set up ensembles or draw weighted samples, in one go.

    Parameters
    ----------
    job : Job
        Without optional terms.
    stage : Starting
        What was found before.

    Returns
    -------
    Checkpoint
        The first stage of sampling, and the density evaluations that it took.

    Raises
    ------
    RefusedError
        As of `StartTask`.
    """
    calls, integrated = 0, False
    while True:
        found = [task.run() for task in tasks(job, stage)]
        looked = [one for one in found if isinstance(one, Looked)]
        if looked:
            stage, used = taken_in(stage, looked)
            calls += used
            continue
        (reached,) = (one for one in found if isinstance(one, Checkpoint))
        calls += reached.calls
        if not isinstance(reached.stage, Starting):
            integrated = integrated or reached.integrated
            return dataclasses.replace(reached, calls=calls, integrated=integrated)
        job, stage, integrated = job.with_error_integrated(), reached.stage, True


def _settled(job: Job) -> Checkpoint:
    """Return the end of a job in which nothing is unknown but the ranges."""
    density = job.density()
    if not np.isfinite(density(np.empty((1, 0)))[0]):
        raise RefusedError("no range allowed by the scene explains every frame")
    check_ranges(density, job.scene, np.empty(0))
    return Checkpoint(Settled(), 1)


def _set_out(job: Job, some: CollapsedDensity, stage: Starting, scouts: Scouts) -> Checkpoint:
    """Climb to the last optima, and set up what comes behind them.

    Parameters
    ----------
    job : Job
        Without optional terms.
    some : CollapsedDensity
        Of all frames, or of so few that optima are looked for in.
    stage : Starting
        What was found so far.
    scouts : Scouts
        Its own.
    """
    whole, optima, calls = job.density(), stage.optima, 0
    density = whole
    if begins_with_a_shape(job, whole):
        begun = from_shapes(job, whole, stage)
        if begun is not None:
            return begun
        optima = [one for one in (refine(some, end.z) for end in optima) if one is not None]
        # they had stopped on their way
        scouts, calls = send_scouts(thinned(some), job.stream(Stream.SCOUTS))
    optima = led_to(scouts, some, optima)
    if optima and depend_on_errors(job, some, optima):
        return Checkpoint(Starting(), calls, None, integrated=True)
    optima = that_matter(optima)
    if job.is_large and optima:
        by, optima, used = represent(density, optima, job.stream(Stream.REPRESENTATIVES))
        job, calls = dataclasses.replace(job, representatives=by), calls + used
        density = job.density()
    if not optima:
        raise RefusedError(
            "no parameters within their priors explain the frames; widen the priors, or check the "
            "noise's `read` against the readings"
        )
    aliases = aliases_of(density)
    if aliases is not None:
        optima = with_aliases(aliases, density, optima)
    check_ranges(whole, job.scene, optima[0].z)
    check_best_fit(whole, optima[0].z)
    first = _first_stage(job, density, optima, scouts)
    calls += first.calls
    return dataclasses.replace(first, calls=calls, representatives=job.representatives)


def _first_stage(
    job: Job, density: CollapsedDensity, optima: list[Optimum], scouts: Scouts
) -> Checkpoint:
    """Set up ensembles, rounds or populations, or draw weighted samples, from optima."""
    proposal = Proposal(mixture_of(optima), None, _SHARE)
    if job.settings.method == "importance":
        return Checkpoint(*_importance(density, proposal, job))
    answer, before = _at_rest(job, density, proposal)
    if answer is not None:
        return Checkpoint(answer, before)
    draws = int(np.clip(evaluations(job) // 4, *_WARM_DRAWS))
    warm = warm_start(density, proposal, scouts.z, job.stream(Stream.WARM), draws)
    calls = before + warm.calls
    by = warm.proposal if warm.fits else proposal
    drawn = None if warm.contradicted else warm.draws
    known = warm.draws if warm.fits else by.optima
    begun = at_once(job, density, known, scouts)
    calls += begun.calls
    if begun.stage is not None or not warm.fits:
        exact = from_scouts(job, density, by, scouts, drawn) or _from_the_prior(by, drawn)
        if begun.stage is None:
            return Checkpoint(exact, calls)
        return Checkpoint(begun.stage, calls, integrated=True, exact=exact)
    reached = _from_warm(job, density, warm, scouts)
    linear = begun.bent is False and isinstance(reached.stage, Weighted)
    return dataclasses.replace(reached, calls=calls + reached.calls, linear=linear)


def _from_the_prior(proposal: Proposal, known: WeightedDraws | None) -> Tempering:
    pending = Verdict(False, ("no steps were made",))
    return Tempering(proposal, (None,) * POPULATIONS, pending, known)


def _from_warm(job: Job, density: CollapsedDensity, warm: Warm, scouts: Scouts) -> Checkpoint:
    """Draw weighted samples behind a warm start that fits, or go on from it."""
    drawn, may_answer, calls = warm.draws, not _has_too_many(density), 0
    if may_answer:
        drawn, calls = _weighted_draws(density, warm.proposal, job)
    # walkers are held to the fewer draws: they are to find what more of these weigh too coarsely
    held_to = drawn if job.settings.method == "auto" else warm.draws
    contradicted = beyond(density, warm.proposal, held_to, scouts.hot) >= TOLERATED
    enough = may_answer and _enough(drawn, job)
    if enough and not contradicted and are_told(job, drawn):
        return Checkpoint(answer_of(job, warm.proposal, drawn.that_count, scouts.z, 0), calls)
    # walkers, too, would hardly ever jump to where no weight leads, or leave where weights are few
    if contradicted or (may_answer and not enough):
        stage = from_scouts(job, density, warm.proposal, scouts, warm.draws)
        if stage is not None:
            return Checkpoint(stage, calls)
    ensembles = from_weighted(job, density, warm.proposal, warm.draws, scouts.z)
    pending = Verdict(False, ("no steps were made",))
    walking = Walking(warm.proposal, ensembles, pending, adaptations=0, weighted=warm.draws)
    return Checkpoint(walking, calls + ensembles[0].walkers * len(ensembles))


def _at_rest(
    job: Job, density: CollapsedDensity, proposal: Proposal
) -> tuple[Weighted | None, int]:
    """Answer by draws from the prior where frames tell two numbers; with the evaluations.

    Also with the method `emcee`: walkers do not follow the sheet that the posterior is.
    """
    rest = at_rest(density)
    if rest is None:
        return None, 0
    drawn, calls = drawn_from_the_prior(rest, job.stream(Stream.AT_REST), job.settings.target_ess)
    if drawn is None:
        return None, calls
    return Weighted(proposal.optima, drawn, Verdict(True, ())), calls


def _has_too_many(density: CollapsedDensity) -> bool:
    """Tell whether there are more aliases of an optimum than a proposal has laws for."""
    aliases = aliases_of(density)
    return aliases is not None and aliases.are_too_many


def _enough(weighted: WeightedDraws, job: Job) -> bool:
    return weighted.k_hat < MAX_K_HAT and weighted.worth >= worth_wanted(job)


def _importance(density: CollapsedDensity, proposal: Proposal, job: Job) -> tuple[Weighted, int]:
    """Sample by importance alone, as was asked for; with the evaluations it took."""
    aliases = aliases_of(density)
    if aliases is not None and aliases.are_too_many:
        raise RefusedError(
            "importance sampling cannot hold all distances of the background that give the same "
            f"readings, each {aliases.turn_m:.4g} m behind the last; narrow the prior of its "
            "distance_m, or use the method emcee"
        )
    weighted, calls = _weighted_draws(density, proposal, job)
    if not weighted.k_hat < MAX_K_HAT:
        raise RefusedError(
            f"importance sampling cannot be trusted here: Pareto k-hat is {weighted.k_hat:.2f}, "
            f"above {MAX_K_HAT}; use the method emcee"
        )
    enough = _enough(weighted, job)
    reason = f"the effective sample size is {weighted.worth:.0f}, below the target"
    verdict = Verdict(enough, () if enough else (reason,))
    return Weighted(proposal.optima, weighted, verdict), calls


def _weighted_draws(
    density: CollapsedDensity, proposal: Proposal, job: Job
) -> tuple[WeightedDraws, int]:
    """Draw until the effective sample size is reached, if that is in sight."""
    target = worth_wanted(job)
    most = min(_MOST_IMPORTANCE_DRAWS, _MOST_IMPORTANCE_FRAMES // len(density.frames))
    count = min(max(_IMPORTANCE_DRAWS, 2 * target), most)
    weighted = draw_weighted(density, proposal, job.stream(Stream.IMPORTANCE), count)
    used = count
    if weighted.k_hat < MAX_K_HAT and weighted.worth < target:
        count = min(int(1.5 * count * target / max(weighted.worth, 1.0)), most)
        weighted = draw_weighted(density, proposal, job.stream(Stream.IMPORTANCE), count)
        used += count
    return weighted, used
