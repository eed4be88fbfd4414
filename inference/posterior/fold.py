"""A posterior as a fold: pure, seeded chunks that any executor can run, in any place.

::

    job = prepare(sensor, scene, frames, settings)
    checkpoint = start(job)
    while pieces := [run(task) for task in tasks(job, checkpoint)]:
        checkpoint = merge(job, checkpoint, pieces)
    posterior = summarise(job, checkpoint, wall_s, cpu_s)

Between chunks a checkpoint may be stored and read again: the result is the same to the last bit.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inference.posterior import summary
from inference.posterior.checks import check_best_fit
from inference.posterior.collapsed import CollapsedDensity
from inference.posterior.diagnostics import (
    autocorrelation_time,
    effective_sample_size,
    split_r_hat,
)
from inference.posterior.draws import draw
from inference.posterior.ensemble import Ensemble, advance, forget, new_ensemble
from inference.posterior.importance import MAX_K_HAT, WeightedDraws, draw_weighted
from inference.posterior.job import Checkpoint, Job, chains, prepare
from inference.posterior.posterior import Posterior
from inference.posterior.proposal import Mixture, adapted, mixture_of
from inference.posterior.selecting import (
    AssessTask,
    StartTask,
    assess_tasks,
    awaits_start,
    begin,
    run_assessment,
    sampled,
    take_in,
)
from inference.posterior.selection import Candidate
from inference.posterior.start import Optimum, climb, find_optima, refine
from inference.posterior.tempering import tempered_walkers
from inference.posterior.verdict import Chains, Verdict, judge
from simulator.errors import RefusedError

__all__ = [
    "Checkpoint",
    "Job",
    "Piece",
    "Progress",
    "Task",
    "draw",
    "merge",
    "prepare",
    "progress",
    "run",
    "start",
    "summarise",
    "tasks",
]

Array = NDArray[np.float64]

WALKERS = 32
_IMPORTANCE_DRAWS = 2000
_MOST_IMPORTANCE_DRAWS = 200_000
_CHUNK_S = 0.33  # of the first chunk; later ones grow to about a second
_MOST_STEPS = 20_000
_TRIAL_DRAWS = 400
_MOST_ADAPTATIONS = 2
_FAST = 10.0  # steps of autocorrelation below which the proposal needs no adaptation
_PILOT_DRAWS = 6000
_EVALUATION_S = 1.2e-6  # a frame under one parameter vector, for sizing chunks only


@dataclasses.dataclass(frozen=True, eq=False)
class Task:
    """One ensemble's share of a chunk."""

    job: Job
    proposal: Mixture
    ensemble: Ensemble
    steps: int


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """An ensemble after its share of a chunk."""

    ensemble: Ensemble
    calls: int


@dataclasses.dataclass(frozen=True)
class Progress:
    """How far a job is.

    Attributes
    ----------
    steps, target : int
        Steps of each ensemble, and how many may be needed as far as can be told.
    ess, rhat : float or None
        Least effective sample size and largest R-hat.
    finished : bool
        Whether only the summary is left.
    """

    steps: int
    target: int
    ess: float | None
    rhat: float | None
    finished: bool


def start(job: Job) -> Checkpoint:
    """Find the optima, and set up ensembles or draw weighted samples.

    With optional terms in the scene this is done once they are decided, by the first chunks.

    Parameters
    ----------
    job : Job
        From `prepare`.

    Returns
    -------
    Checkpoint

    Raises
    ------
    RefusedError
        Where no parameters explain the frames at all, or importance sampling alone was asked for
        and cannot be trusted.
    """
    if job.scene.optional_terms:
        return begin(job)
    density = job.density()
    settings = job.settings
    pending = Verdict(False, ("no steps were made",))
    if len(density.parameters) == 0:
        known = Verdict(True, ())
        if not np.isfinite(density(np.empty((1, 0)))[0]):
            raise RefusedError("no range allowed by the scene explains every frame")
        return Checkpoint("importance", None, None, 0, (), None, 1, known, None, None, True)
    optima = find_optima(density, job.stream(0))
    tempered, calls = tempered_walkers(density, job.stream(1), WALKERS)
    if len(tempered):
        optima = _with(optima, refine(density, climb(density, tempered[0])[0]))
        optima = _with(optima, refine(density, tempered[0]))
    if not optima:
        raise RefusedError(
            "no parameters within their priors explain the frames; widen the priors, or check the "
            "noise's `read` against the readings"
        )
    check_best_fit(density, optima[0].z)
    mixture = mixture_of(optima)
    if settings.method in ("importance", "auto"):
        weighted, used = _importance(density, mixture, job)
        calls += used
        trusted = weighted.k_hat < MAX_K_HAT and weighted.ess >= settings.target_ess
        if trusted or settings.method == "importance":
            if not weighted.k_hat < MAX_K_HAT:
                raise RefusedError(
                    f"importance sampling cannot be trusted here: Pareto k-hat is "
                    f"{weighted.k_hat:.2f}, above {MAX_K_HAT}; use the method emcee"
                )
            verdict = Verdict(
                trusted,
                ()
                if trusted
                else (f"the effective sample size is {weighted.ess:.0f}, below the target",),
            )
            return Checkpoint(
                "importance",
                mixture,
                mixture,
                0,
                (),
                weighted,
                calls,
                verdict,
                weighted.ess,
                None,
                True,
            )
    trial = draw_weighted(density, mixture, job.stream(8), _TRIAL_DRAWS)
    calls += _TRIAL_DRAWS
    if trial.ess > 0.5 * _TRIAL_DRAWS:  # jumps that are mostly accepted forget fastest
        mixture = dataclasses.replace(mixture, share=0.8)
    ensembles = _ensembles(density, mixture, tempered, job)
    calls += WALKERS * len(ensembles)
    return Checkpoint(
        "emcee", mixture, mixture, 0, ensembles, None, calls, pending, None, None, False
    )


def _with(optima: list[Optimum], found: Optimum | None) -> list[Optimum]:
    """Add an optimum that is not among those found before, and drop what it makes negligible."""
    if found is None:
        return optima
    for other in optima:
        step = np.linalg.solve(other.factor, found.z - other.z)
        if np.linalg.norm(step) < 0.5:
            return optima
    every = sorted([*optima, found], key=lambda optimum: -optimum.log_density)
    return [o for o in every if o.log_density > every[0].log_density - 20.0]


def _importance(density: CollapsedDensity, mixture: Mixture, job: Job) -> tuple[WeightedDraws, int]:
    """Draw until the effective sample size is reached, if that is in sight."""
    count = max(_IMPORTANCE_DRAWS, 2 * job.settings.target_ess)
    weighted = draw_weighted(density, mixture, job.stream(2), count)
    used = count
    if weighted.k_hat < MAX_K_HAT and weighted.ess < job.settings.target_ess:
        wanted = int(1.5 * count * job.settings.target_ess / max(weighted.ess, 1.0))
        count = min(wanted, _MOST_IMPORTANCE_DRAWS)
        weighted = draw_weighted(density, mixture, job.stream(2), count)
        used += count
    return weighted, used


def _ensembles(
    density: CollapsedDensity, mixture: Mixture, tempered: Array, job: Job
) -> tuple[Ensemble, ...]:
    """Set up the ensembles: the last from the tempered prior, the others around the optima."""
    seeds = np.random.SeedSequence(job.seed, spawn_key=(3,)).spawn(job.settings.ensembles)
    d = mixture.centres.shape[1]
    ensembles = []
    for k, seed in enumerate(seeds):
        coords = np.empty((0, d))
        if k == len(seeds) - 1 and np.linalg.matrix_rank(tempered - tempered[:1]) == d:
            coords = tempered
        rng = np.random.default_rng(seed.spawn(1)[0])
        log_prob = density(coords) if len(coords) else np.empty(0)
        for _ in range(50):
            if len(coords) >= WALKERS:
                break
            more = mixture.draw(rng, WALKERS)
            found = density(more)
            coords = np.concatenate([coords, more[np.isfinite(found)]])
            log_prob = np.concatenate([log_prob, found[np.isfinite(found)]])
        if len(coords) < WALKERS:
            raise RefusedError("the prior leaves no room around its best parameters")
        ensembles.append(new_ensemble(coords[:WALKERS], log_prob[:WALKERS], seed))
    return tuple(ensembles)


def tasks(
    job: Job, checkpoint: Checkpoint
) -> tuple[Task, ...] | tuple[AssessTask | StartTask, ...]:
    """Return the independent parts of the next chunk; none when the job is finished.

    The size of a chunk is counted in evaluations, never timed, so that it is the same everywhere.
    """
    if before := assess_tasks(job, checkpoint):
        return before
    job = sampled(job, checkpoint)
    proposal = checkpoint.proposal
    if checkpoint.finished or proposal is None:
        return ()
    done = checkpoint.ensembles[0].steps
    step_s = 5e-4 + WALKERS * int(job.usable.sum()) * _EVALUATION_S
    seconds = _CHUNK_S if done == 0 else 2 * _CHUNK_S
    steps = int(min(max(seconds / step_s, 20), 500, _MOST_STEPS - done))
    return tuple(Task(job, proposal, ensemble, steps) for ensemble in checkpoint.ensembles)


def run(task: Task | AssessTask | StartTask) -> Piece | Candidate | Checkpoint:
    """Run one part of a chunk."""
    if isinstance(task, AssessTask):
        return run_assessment(task)
    if isinstance(task, StartTask):
        return start(task.job)
    ensemble = advance(task.job.density(), task.proposal, task.ensemble, task.steps)
    return Piece(ensemble, task.steps * WALKERS)


def merge(
    job: Job, checkpoint: Checkpoint, pieces: Sequence[Piece | Candidate | Checkpoint]
) -> Checkpoint:
    """Take in the parts of a chunk, in the order of `tasks`, and judge the draws so far."""
    candidates = tuple(piece for piece in pieces if isinstance(piece, Candidate))
    if candidates:
        return take_in(job, checkpoint, candidates)
    for piece in pieces:
        if isinstance(piece, Checkpoint):
            calls = checkpoint.calls + piece.calls
            return dataclasses.replace(piece, calls=calls, selection=checkpoint.selection)
    job = sampled(job, checkpoint)
    moved = [piece for piece in pieces if isinstance(piece, Piece)]
    checkpoint = dataclasses.replace(
        checkpoint,
        ensembles=tuple(piece.ensemble for piece in moved),
        calls=checkpoint.calls + sum(piece.calls for piece in moved),
    )
    kept = chains(job, checkpoint)
    if checkpoint.adaptations < _MOST_ADAPTATIONS and _is_slow(kept):
        return _adapt(job, checkpoint, kept)
    verdict = judge(kept, job.settings.target_ess)
    columns = np.moveaxis(kept.z, -1, 0)
    least = min(effective_sample_size(draws) for draws in columns)
    worst = max(split_r_hat(draws) for draws in columns)
    return dataclasses.replace(
        checkpoint,
        verdict=verdict,
        ess=least if math.isfinite(least) else None,
        r_hat=worst if math.isfinite(worst) else None,
        finished=verdict.converged or checkpoint.ensembles[0].steps >= _MOST_STEPS,
    )


def _is_slow(kept: Chains) -> bool:
    """Tell whether some parameter needs more than a few steps to be forgotten."""
    steps = kept.z.shape[2]
    taus = [autocorrelation_time(x.reshape(-1, steps).T) for x in np.moveaxis(kept.z, -1, 0)]
    return not max(taus) < _FAST  # a parameter that does not move has no finite time


def _adapt(job: Job, checkpoint: Checkpoint, kept: Chains) -> Checkpoint:
    """Adapt the proposal to what was drawn so far, and forget the draws."""
    if checkpoint.optima is None:
        raise ValueError("nothing was sampled")
    rng = job.stream(6 + checkpoint.adaptations)
    flat = kept.z.reshape(-1, kept.z.shape[-1])
    pilot = flat[np.linspace(0, len(flat) - 1, min(len(flat), _PILOT_DRAWS)).astype(int)]
    return dataclasses.replace(
        checkpoint,
        proposal=adapted(checkpoint.optima, pilot, rng),
        adaptations=checkpoint.adaptations + 1,
        ensembles=tuple(forget(ensemble) for ensemble in checkpoint.ensembles),
        verdict=Verdict(False, ("the proposal was still being adapted",)),
    )


def progress(job: Job, checkpoint: Checkpoint) -> Progress:
    """Tell how far a job is."""
    if awaits_start(checkpoint):
        return Progress(0, _MOST_STEPS, None, None, False)
    if checkpoint.method == "importance":
        count = 0 if checkpoint.weighted is None else len(checkpoint.weighted.z)
        return Progress(count, count, checkpoint.ess, None, checkpoint.finished)
    steps = checkpoint.ensembles[0].steps
    target = steps
    if not checkpoint.finished:
        share = (checkpoint.ess or 1.0) / job.settings.target_ess
        target = int(min(max(steps / share, steps + 1), _MOST_STEPS)) if steps else _MOST_STEPS
    return Progress(steps, target, checkpoint.ess, checkpoint.r_hat, checkpoint.finished)


def summarise(job: Job, checkpoint: Checkpoint, wall_s: float, cpu_s: float) -> Posterior:
    """Make the answer of a job, finished or not.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands; where it was stopped before its optional terms were decided,
        all of them are kept.
    wall_s, cpu_s : float
        What it has cost so far [s].

    Returns
    -------
    Posterior
    """
    if awaits_start(checkpoint):
        started = start(sampled(job, checkpoint))
        checkpoint = dataclasses.replace(
            started, selection=checkpoint.selection, calls=checkpoint.calls + started.calls
        )
    return summary.summarise(job, checkpoint, wall_s, cpu_s)
