"""How sampling starts: optima, a first trial of their shape, and ensembles around them."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.checks import check_best_fit, check_ranges
from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of, with_aliases
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.represent import represent
from inference.posterior.sampling.start import Optimum, climb, climbed, optima_of, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import beyond, warm_start
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.ensembles import POPULATIONS, from_weighted
from inference.posterior.stages.optima import added, depend_on_errors, that_matter
from inference.posterior.stages.scouting import Scouts, from_scouts, send_scouts, thinned
from inference.posterior.stages.setting_out import TOLERATED
from inference.posterior.stages.stage import (
    Drawing,
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from inference.posterior.streams import Stream
from simulator.errors import RefusedError

__all__ = ["StartTask", "begin"]

Array = NDArray[np.float64]

_IMPORTANCE_DRAWS = 2000
_MOST_IMPORTANCE_DRAWS = 200_000
_MOST_IMPORTANCE_FRAMES = 8_000_000  # draws times frames: ten seconds that nothing interrupts
_WARM_DRAWS = (400, 1000)  # fewest and most: a quarter of a second of them
_SHARE = 0.5  # of an ensemble's steps that are independent jumps


@dataclasses.dataclass(frozen=True, eq=False)
class StartTask:
    """One way of looking for optima in the scene that was chosen; behind the last, the start.

    Attributes
    ----------
    job : Job
        Without optional terms.
    stage : Starting
        What was found before.
    """

    job: Job
    stage: Starting

    def run(self) -> Checkpoint:
        """Return what is known then, and the density evaluations that were counted."""
        job, stage = self.job, self.stage
        if len(job.density().parameters) == 0:
            return _settled(job)
        some = _of_some_frames(job) if job.is_large else job
        density = some.density()
        if stage.ends is None:
            ends = climbed(density, job.stream(Stream.SCREEN))
            return Checkpoint(dataclasses.replace(stage, ends=ends), 0)
        if stage.optima is None:
            optima = optima_of(density, stage.ends)
            return Checkpoint(dataclasses.replace(stage, optima=tuple(optima)), 0)
        optima = list(stage.optima)
        if not stage.fitted:
            for fitted in fitted_optima(some, density):
                optima = added(optima, fitted)
            return Checkpoint(dataclasses.replace(stage, optima=tuple(optima), fitted=True), 0)
        return _set_out(job, density, optima)


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
        Where no parameters explain the frames at all, or importance sampling alone was asked for
        and cannot be trusted.
    """
    reached, integrated = StartTask(job, stage).run(), False
    while isinstance(reached.stage, Starting):
        if reached.integrated:
            job, integrated = job.with_error_integrated(), True
        reached = StartTask(job, reached.stage).run()
    return dataclasses.replace(reached, integrated=integrated)


def _settled(job: Job) -> Checkpoint:
    """Return the end of a job in which nothing is unknown but the ranges."""
    density = job.density()
    if not np.isfinite(density(np.empty((1, 0)))[0]):
        raise RefusedError("no range allowed by the scene explains every frame")
    check_ranges(density, job.scene, np.empty(0))
    return Checkpoint(Settled(), 1)


def _set_out(job: Job, some: CollapsedDensity, optima: list[Optimum]) -> Checkpoint:
    """Look for the last optima, and set up what comes behind them.

    Parameters
    ----------
    job : Job
        Without optional terms.
    some : CollapsedDensity
        Of all frames, or of so few that optima are looked for in.
    optima : list of Optimum
        Found so far.
    """
    whole = density = job.density()
    optima, scouts, calls = _with_scouts(job, some, optima)
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
    stage, used = _first_stage(job, density, optima, scouts)
    return Checkpoint(stage, calls + used, None, job.representatives)


def _of_some_frames(job: Job) -> Job:
    """Return the job of so few frames that every branch is seen, with and without object."""
    rng, usable = job.stream(Stream.REPRESENTATIVES, 0), np.flatnonzero(job.usable)
    present = job.frames.object_present
    holds = np.ones(len(usable), dtype=bool) if present is None else present[usable]
    some = [rng.permutation(usable[flag])[:most] for flag, most in ((holds, 250), (~holds, 50))]
    return job.part(np.sort(np.concatenate(some)))


def _first_stage(
    job: Job, density: CollapsedDensity, optima: list[Optimum], scouts: Scouts
) -> tuple[Drawing, int]:
    """Set up ensembles or draw weighted samples, from optima; with the evaluations it took."""
    proposal = Proposal(mixture_of(optima), None, _SHARE)
    if job.settings.method == "importance":
        return _importance(density, proposal, job)
    draws = int(np.clip(evaluations(job) // 4, *_WARM_DRAWS))
    warm = warm_start(density, proposal, scouts.z, job.stream(Stream.WARM), draws)
    calls = warm.calls
    pending = Verdict(False, ("no steps were made",))
    if not warm.fits:
        known = None if warm.contradicted else warm.draws
        stage = from_scouts(job, density, proposal, scouts, known)
        return stage or Tempering(proposal, (None,) * POPULATIONS, pending, known), calls
    drawn, may_answer = warm.draws, job.settings.method == "auto" and not _has_too_many(density)
    if may_answer:
        drawn, used = _weighted_draws(density, warm.proposal, job)
        calls += used
    contradicted = beyond(density, warm.proposal, drawn, scouts.hot) >= TOLERATED
    if may_answer and _enough(drawn, job) and not contradicted:
        return Weighted(proposal.optima, drawn.that_count, Verdict(True, ())), calls
    # walkers, too, would hardly ever jump to where no weight leads
    if contradicted and (stage := from_scouts(job, density, warm.proposal, scouts, warm.draws)):
        return stage, calls
    ensembles = from_weighted(job, density, warm.proposal, warm.draws, scouts.z)
    walking = Walking(warm.proposal, ensembles, pending, adaptations=0, weighted=warm.draws)
    return walking, calls + ensembles[0].walkers * len(ensembles)


def _with_scouts(
    job: Job, density: CollapsedDensity, optima: list[Optimum]
) -> tuple[list[Optimum], Scouts, int]:
    """Add optima that scouts find, and return these, told to none; with the evaluations."""
    found, calls = send_scouts(thinned(density), job.stream(Stream.SCOUTS))
    if len(found.z):
        optima = added(optima, refine(density, climb(density, found.z[0])[0]))
        optima = added(optima, refine(density, found.z[0]))
    return optima, found, calls


def _has_too_many(density: CollapsedDensity) -> bool:
    """Tell whether there are more aliases of an optimum than a proposal has laws for."""
    aliases = aliases_of(density)
    return aliases is not None and aliases.are_too_many


def _enough(weighted: WeightedDraws, job: Job) -> bool:
    return weighted.k_hat < MAX_K_HAT and weighted.worth >= job.settings.target_ess


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
    target = job.settings.target_ess
    most = min(_MOST_IMPORTANCE_DRAWS, _MOST_IMPORTANCE_FRAMES // len(density.frames))
    count = min(max(_IMPORTANCE_DRAWS, 2 * target), most)
    weighted = draw_weighted(density, proposal, job.stream(Stream.IMPORTANCE), count)
    used = count
    if weighted.k_hat < MAX_K_HAT and weighted.worth < target:
        count = min(int(1.5 * count * target / max(weighted.worth, 1.0)), most)
        weighted = draw_weighted(density, proposal, job.stream(Stream.IMPORTANCE), count)
        used += count
    return weighted, used
