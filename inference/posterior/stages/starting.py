"""How sampling starts: optima, a first trial of their shape, and ensembles around them."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.density.collapsed import CollapsedDensity
from inference.posterior.checks import check_best_fit, check_ranges
from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Job
from inference.posterior.sampling.aliases import aliases_of, with_aliases
from inference.posterior.sampling.effort import scouts
from inference.posterior.sampling.ensemble import WALKERS, Ensemble, warm_walkers
from inference.posterior.sampling.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.sampling.population import carried
from inference.posterior.sampling.proposal import Proposal, mixture_of
from inference.posterior.sampling.represent import represent
from inference.posterior.sampling.start import Optimum, climb, climbed, optima_of, refine
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.sampling.warm import Warm, warm_start
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.chunk import evaluations
from inference.posterior.stages.ensembles import POPULATIONS, new_ensembles
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

_SCOUTED_FRAMES = 200  # at most; the walkers then start the wider, the more frames there are
_SCOUTS = 2 * WALKERS
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
                optima = _with(optima, fitted)
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
    reached = StartTask(job, stage).run()
    while isinstance(reached.stage, Starting):
        reached = StartTask(job, reached.stage).run()
    return reached


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
    optima, scouted, calls = _with_scouts(job, some, optima)
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
    stage, used = _first_stage(job, density, optima, scouted)
    return Checkpoint(stage, calls + used, None, job.representatives)


def _of_some_frames(job: Job) -> Job:
    """Return the job of so few frames that every branch is seen, with and without object."""
    rng, usable = job.stream(Stream.REPRESENTATIVES, 0), np.flatnonzero(job.usable)
    present = job.frames.object_present
    holds = np.ones(len(usable), dtype=bool) if present is None else present[usable]
    some = [rng.permutation(usable[flag])[:most] for flag, most in ((holds, 250), (~holds, 50))]
    return job.part(np.sort(np.concatenate(some)))


def _first_stage(
    job: Job, density: CollapsedDensity, optima: list[Optimum], scouted: Array
) -> tuple[Drawing, int]:
    """Set up ensembles or draw weighted samples, from optima; with the evaluations it took."""
    calls, proposal = 0, Proposal(mixture_of(optima), None, _SHARE)
    if job.settings.method in ("importance", "auto"):
        weighted, used = _importance(density, proposal, job)
        calls += used
        if weighted is not None:
            return weighted, calls
    draws = int(np.clip(evaluations(job) // 4, *_WARM_DRAWS))
    warm = warm_start(density, proposal, scouted, job.stream(Stream.WARM), draws)
    calls += warm.calls
    pending = Verdict(False, ("no steps were made",))
    if not warm.fits:
        known = None if warm.contradicted else warm.draws
        return Tempering(proposal, (None,) * POPULATIONS, pending, known), calls
    ensembles = _ensembles(job, density, warm, scouted)
    walking = Walking(warm.proposal, ensembles, pending, adaptations=0, weighted=warm.draws)
    return walking, calls + ensembles[0].walkers * len(ensembles)


def _ensembles(
    job: Job, density: CollapsedDensity, warm: Warm, scouted: Array
) -> tuple[Ensemble, ...]:
    """Start the last ensemble from the scouts, the others from different weighted draws."""
    draws, count = warm.draws, job.settings.ensembles - 1
    rng, walkers = job.stream(Stream.MEMBERS), warm_walkers(len(density.parameters))
    most = min(walkers * count, int(np.count_nonzero(draws.weights)))
    order = rng.choice(len(draws.z), size=most, replace=False, p=draws.weights)
    starts = tuple(draws.z[order[k::count]] for k in range(count))
    seeds = job.seeds(Stream.ENSEMBLES)
    return new_ensembles(density, warm.proposal, (*starts, scouted), seeds, walkers)


def _with_scouts(
    job: Job, density: CollapsedDensity, optima: list[Optimum]
) -> tuple[list[Optimum], Array, int]:
    """Add optima that scouts find, and return these, told to none; with the evaluations."""
    found, calls = _scouted(_thinned(density), job.stream(Stream.SCOUTS))
    if len(found):
        optima = _with(optima, refine(density, climb(density, found[0])[0]))
        optima = _with(optima, refine(density, found[0]))
    return optima, found, calls


def _scouted(density: CollapsedDensity, rng: np.random.Generator) -> tuple[Array, int]:
    """Return where scouts stand, the best first, and the evaluations that it took.

    They come from the prior alone: an ensemble that starts from them can contradict those that
    start from the optima.
    """
    found = carried(density, rng, scouts(_SCOUTS))
    total = found.log_likelihood + found.log_prior
    # a random half: the better half would lose a mode of little density, however wide
    _, first = np.unique(found.z, axis=0, return_index=True)
    kept = rng.permutation(first)[:WALKERS]
    return found.z[kept[np.argsort(-total[kept])]], found.calls


def _thinned(density: CollapsedDensity) -> CollapsedDensity:
    """Return the density of some of the frames, spread over all: enough to show every branch."""
    n = len(density.frames)
    if n <= _SCOUTED_FRAMES:
        return density
    chosen = np.linspace(0, n - 1, _SCOUTED_FRAMES).round().astype(int)
    present = None if density.present is None else density.present[chosen]
    frames = np.ascontiguousarray(density.frames[chosen])
    return dataclasses.replace(density, frames=frames, present=present, weights=None)


def _with(optima: list[Optimum], found: Optimum | None) -> list[Optimum]:
    """Add an optimum that is not among those found before, and drop what it makes negligible."""
    if found is None:
        return optima
    if any(other.is_near(found.z) for other in optima):
        return optima
    every = sorted([*optima, found], key=lambda optimum: -optimum.log_density)
    return [o for o in every if o.log_density > every[0].log_density - 20.0]


def _importance(
    density: CollapsedDensity, proposal: Proposal, job: Job
) -> tuple[Weighted | None, int]:
    """Sample by importance; None where ensembles are to do it instead."""
    target, forced = job.settings.target_ess, job.settings.method == "importance"
    aliases = aliases_of(density)
    if aliases is not None and aliases.are_too_many:
        if not forced:
            return None, 0
        raise RefusedError(
            "importance sampling cannot hold all distances of the background that give the same "
            f"readings, each {aliases.turn_m:.4g} m behind the last; narrow the prior of its "
            "distance_m, or use the method emcee"
        )
    weighted, calls = _weighted_draws(density, proposal, job)
    trusted = weighted.k_hat < MAX_K_HAT
    if forced and not trusted:
        raise RefusedError(
            f"importance sampling cannot be trusted here: Pareto k-hat is {weighted.k_hat:.2f}, "
            f"above {MAX_K_HAT}; use the method emcee"
        )
    enough = trusted and weighted.ess >= target
    if not (enough or forced):
        return None, calls
    reason = f"the effective sample size is {weighted.ess:.0f}, below the target"
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
    if weighted.k_hat < MAX_K_HAT and weighted.ess < target:
        count = min(int(1.5 * count * target / max(weighted.ess, 1.0)), most)
        weighted = draw_weighted(density, proposal, job.stream(Stream.IMPORTANCE), count)
        used += count
    return weighted, used
