"""A posterior as a fold: pure, seeded chunks that any executor can run, in any place.

::

    job = prepare(sensor, scene, frames, settings)
    checkpoint = start(job)
    while pieces := [run(task) for task in tasks(job, checkpoint)]:
        checkpoint = merge(job, checkpoint, pieces)
    posterior = summarise(job, checkpoint, wall_s, cpu_s)

Between chunks a checkpoint may be stored and read again: the result is the same to the last bit.

Where the Laplace shapes at the optima fit, ensembles walk at once. Where they do not, populations
are first carried from the prior to the posterior, a map is fitted to them, and ensembles walk in
its coordinates.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from inference.posterior import summary
from inference.posterior.adaptation import adapt, is_slow, set_out
from inference.posterior.answer.draws import Draws, draws_of
from inference.posterior.answer.posterior import Posterior
from inference.posterior.job import Checkpoint, Job, chains, prepare
from inference.posterior.launch import WALKERS, start
from inference.posterior.sample import sample_of
from inference.posterior.sampling.diagnostics import effective_sample_size, split_r_hat
from inference.posterior.sampling.ensemble import Ensemble, advance
from inference.posterior.sampling.population import Population, first_population, temper
from inference.posterior.sampling.proposal import Proposal
from inference.posterior.sampling.verdict import judge
from inference.posterior.selecting import (
    AssessTask,
    StartTask,
    assess_tasks,
    awaits_start,
    run_assessment,
    sampled,
    take_in,
)
from inference.posterior.selection.candidates import Candidate

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


_CHUNK_S = 0.33  # of the first chunk; later ones grow to about a second
_MOST_STEPS = 20_000
_EVALUATION_S = 1.2e-6  # a frame under one parameter vector, for sizing chunks only
_WITH_DISCREPANCY = 10.0  # times as long, where the flux's error is integrated out


@dataclasses.dataclass(frozen=True, eq=False)
class Task:
    """One share of a chunk: steps of an ensemble, or temperatures of a population.

    Attributes
    ----------
    job : Job
        The job.
    proposal : Proposal or None
        Of the ensemble.
    ensemble : Ensemble or None
        None where populations are carried to the posterior.
    population : Population or None
        None before it is drawn from the prior.
    index : int
        Of the ensemble or the population.
    steps : int
        Steps of an ensemble; of a population the density evaluations after which to stop.
    """

    job: Job
    proposal: Proposal | None
    ensemble: Ensemble | None
    population: Population | None
    index: int
    steps: int


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """An ensemble or a population after its share of a chunk."""

    ensemble: Ensemble | None
    population: Population | None
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
    evaluation_s = int(job.usable.sum()) * _EVALUATION_S
    if job.scene.discrepancy is not None:
        evaluation_s *= _WITH_DISCREPANCY
    if not checkpoint.ensembles:
        calls = int(3 * _CHUNK_S / evaluation_s)
        return tuple(
            Task(job, None, None, population, k, calls)
            for k, population in enumerate(checkpoint.populations)
            if not _has_arrived(population)
        )
    done = checkpoint.ensembles[0].steps
    step_s = 5e-4 + WALKERS * evaluation_s
    seconds = _CHUNK_S if done == 0 else 2 * _CHUNK_S
    steps = int(min(max(seconds / step_s, 20), 500, _MOST_STEPS - done))
    return tuple(
        Task(job, proposal, ensemble, None, k, steps)
        for k, ensemble in enumerate(checkpoint.ensembles)
    )


def _has_arrived(population: Population | None) -> bool:
    """Tell whether a population is at the posterior, or died on the way."""
    return population is not None and (population.power == 1.0 or len(population.z) == 0)


def run(task: Task | AssessTask | StartTask) -> Piece | Candidate | Checkpoint:
    """Run one part of a chunk."""
    if isinstance(task, AssessTask):
        return run_assessment(task)
    if isinstance(task, StartTask):
        return start(task.job)
    density = task.job.density()
    if task.ensemble is not None and task.proposal is not None:
        ensemble = advance(density, task.proposal, task.ensemble, task.steps)
        return Piece(ensemble, None, task.steps * WALKERS)
    population = task.population
    before = 0 if population is None else population.calls
    if population is None:
        population = first_population(density, task.job.stream(9, task.index, 0))
    while not _has_arrived(population) and population.calls - before < task.steps:
        rng = task.job.stream(9, task.index, 1 + population.steps)
        population = temper(density, population, rng)
    return Piece(None, population, population.calls - before)


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
    calls = checkpoint.calls + sum(piece.calls for piece in moved)
    checkpoint = dataclasses.replace(checkpoint, calls=calls)
    ensembles = tuple(piece.ensemble for piece in moved if piece.ensemble is not None)
    if not ensembles:
        carried = iter(piece.population for piece in moved)
        populations = tuple(
            population if _has_arrived(population) else next(carried)
            for population in checkpoint.populations
        )
        checkpoint = dataclasses.replace(checkpoint, populations=populations)
        return set_out(job, checkpoint) if all(map(_has_arrived, populations)) else checkpoint
    checkpoint = dataclasses.replace(checkpoint, ensembles=ensembles)
    kept = chains(job, checkpoint)
    if is_slow(kept, checkpoint.adaptations):
        return adapt(job, checkpoint, kept)
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


def progress(job: Job, checkpoint: Checkpoint) -> Progress:
    """Tell how far a job is."""
    if awaits_start(checkpoint):
        return Progress(0, _MOST_STEPS, None, None, False)
    if checkpoint.method == "importance":
        count = 0 if checkpoint.weighted is None else len(checkpoint.weighted.z)
        return Progress(count, count, checkpoint.ess, None, checkpoint.finished)
    steps = checkpoint.ensembles[0].steps if checkpoint.ensembles else 0
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
    return summary.summarise(job, _started(job, checkpoint), wall_s, cpu_s)


def draw(job: Job, checkpoint: Checkpoint) -> tuple[Job, Draws]:
    """Return the draws behind the answer of a job, the same as `summarise` makes it from.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.

    Returns
    -------
    (Job, Draws)
        The job with the terms that were kept, and its draws.
    """
    checkpoint = _started(job, checkpoint)
    job = sampled(job, checkpoint)
    density, rng = job.density(), job.stream(4)
    return job, draws_of(density, job, sample_of(density, job, checkpoint, rng), rng)


def _started(job: Job, checkpoint: Checkpoint) -> Checkpoint:
    """Return the checkpoint, with starting points where its terms were all there was time for."""
    if not awaits_start(checkpoint):
        return checkpoint
    started = start(sampled(job, checkpoint))
    return dataclasses.replace(
        started, selection=checkpoint.selection, calls=checkpoint.calls + started.calls
    )
