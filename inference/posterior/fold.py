"""A posterior as a fold: pure, seeded chunks that any executor can run, in any place.

::

    job = prepare(sensor, scene, frames, settings)
    checkpoint = start(job)
    while pieces := [run(task) for task in tasks(job, checkpoint, seconds_so_far)]:
        checkpoint = merge(job, checkpoint, pieces)
    posterior = summarise(job, checkpoint, wall_s, cpu_s)

Between chunks a checkpoint may be stored and read again: the result is the same to the last bit.

Where weighted draws from the Laplace shapes at the optima, or from maps fitted to them, are even
and points from the prior do not contradict them, they are the answer with the method `auto`. Where
not, rounds of weighted draws follow from the points from the prior, and where these do not do from
populations that are carried from the prior to the posterior. Such draws are the answer with `auto`,
where the points or populations agree with them; otherwise ensembles walk in the last map's
coordinates. Where linear response to the model's errors bends around such draws, rounds follow from
where it moves them, with the errors integrated out; where it bends around draws of Laplace shapes
that do not fit, they begin there. With `emcee` many walkers make some steps from what `auto` would
answer with. Of an object at rest before unknown crosstalk draws from the prior are the answer with
either. What each stage does is in `inference.posterior.stages`.
"""

import dataclasses
from collections.abc import Sequence
from typing import TypeVar

from inference.density.collapsed import KERNELS
from inference.posterior.archive import FORMAT
from inference.posterior.job import Job, prepare
from inference.posterior.libraries import import_libraries
from inference.posterior.progress import Progress
from inference.posterior.sampling.ensemble import Ensemble
from inference.posterior.sampling.population import Population
from inference.posterior.selection.models import Candidate
from inference.posterior.stages import (
    responding,
    selecting,
    starting,
    tempering,
    walking,
    walking_on,
)
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.looking import Looked, LookTask, ShapeTask, taken_in
from inference.posterior.stages.responding import RespondTask
from inference.posterior.stages.selecting import AssessTask, sampled
from inference.posterior.stages.setting_out import (
    Evaluated,
    EvaluateTask,
    SetOutTask,
    put_together,
)
from inference.posterior.stages.stage import (
    Selecting,
    Settled,
    Starting,
    Tempering,
    Walking,
    Weighted,
)
from inference.posterior.stages.starting import StartTask
from inference.posterior.stages.tempering import TemperTask
from inference.posterior.stages.walking import WalkTask
from inference.posterior.stages.walking_on import WalkOnTask
from inference.posterior.summary import draw, summarise
from simulator.compiled import at_once
from simulator.one_thread import one_thread

__all__ = [
    "FORMAT",
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

Task = (
    AssessTask
    | LookTask
    | ShapeTask
    | StartTask
    | TemperTask
    | SetOutTask
    | EvaluateTask
    | WalkTask
    | RespondTask
    | WalkOnTask
)
Piece = Candidate | Looked | Evaluated | Checkpoint | Population | Ensemble
P = TypeVar("P")


def start(job: Job) -> Checkpoint:
    """Return where a job begins: with its optional terms, or with starting points.

    Parameters
    ----------
    job : Job
        From `prepare`.

    Returns
    -------
    Checkpoint
    """
    return Checkpoint(selecting.begun(job) if job.scene.optional_terms else Starting(), 0)


def tasks(job: Job, checkpoint: Checkpoint, cpu_s: float = 0.0) -> tuple[Task, ...]:
    """Return the independent parts of the next chunk; none when the job is finished.

    Parameters
    ----------
    job, checkpoint : Job, Checkpoint
        The job and where it stands.
    cpu_s : float
        Processor time that the job has taken so far [s], compiling apart; beyond `max_seconds` of
        the settings no chunk begins. Left out, time plays no part.
    """
    if cpu_s >= job.settings.max_seconds:
        return ()
    match checkpoint.stage:
        case Selecting() as stage:
            return selecting.tasks(job, stage)
        case Starting() as stage:
            return starting.tasks(sampled(job, checkpoint), stage)
        case Tempering() as stage:
            return tempering.tasks(sampled(job, checkpoint), stage)
        case Walking() as stage if not stage.finished:
            return walking.tasks(sampled(job, checkpoint), stage)
        case Walking() | Weighted() | Settled():
            return responding.tasks(job, checkpoint) or walking_on.tasks(job, checkpoint)


@one_thread()
def run(task: Task) -> Piece:
    """Run one part of a chunk.

    Parameters
    ----------
    task : Task
        From `tasks`.

    Returns
    -------
    Piece
        For `merge`.

    Raises
    ------
    RefusedError
        By one that looks for starting points, where no parameters explain the frames at all, or
        importance sampling alone was asked for and cannot be trusted.
    """
    import_libraries()
    with at_once(*KERNELS):
        return task.run()


@one_thread()
def merge(job: Job, checkpoint: Checkpoint, pieces: Sequence[Piece]) -> Checkpoint:
    """Take in the parts of a chunk, in the order of `tasks`, and judge the draws so far."""
    calls = checkpoint.calls
    match checkpoint.stage:
        case Selecting() as stage if stage.looking:
            found, used = selecting.looked(stage, _all(Looked, pieces))
            return Checkpoint(found, calls + used)
        case Selecting() as stage:
            selection, start, used = selecting.decided(job, stage, _all(Candidate, pieces))
            return Checkpoint(start, calls + used, selection)
        case Starting() as stage if any(isinstance(piece, Looked) for piece in pieces):
            start, used = taken_in(stage, _all(Looked, pieces))
            return dataclasses.replace(checkpoint, stage=start, calls=calls + used)
        case Starting():
            return _after(checkpoint, pieces)
        case Tempering() as stage if any(isinstance(piece, Evaluated) for piece in pieces):
            evaluated = _all(Evaluated, pieces)
            with at_once(*KERNELS):  # ensembles may set out from there
                reached = put_together(sampled(job, checkpoint), stage, evaluated)
            return _after(checkpoint, (reached,))
        case Tempering() as stage if stage.arrived:
            return _after(checkpoint, pieces)
        case Tempering() as stage:
            carried = _all(Population, pieces)
            after, used = tempering.merge(sampled(job, checkpoint), stage, carried)
            return dataclasses.replace(checkpoint, stage=after, calls=calls + used)
        case Walking() as stage if not stage.finished:
            ensembles = _all(Ensemble, pieces)
            after, used = walking.merge(sampled(job, checkpoint), stage, ensembles)
            return dataclasses.replace(checkpoint, stage=after, calls=calls + used)
        case Walking() | Weighted() | Settled():
            if not (responding.tasks(job, checkpoint) or walking_on.tasks(job, checkpoint)):
                raise ValueError("the job is finished: there is nothing to take in")
            return _after(checkpoint, pieces)


def _after(checkpoint: Checkpoint, pieces: Sequence[object]) -> Checkpoint:
    """Return where a task that decides on the next stage has come to."""
    (reached,) = _all(Checkpoint, pieces)
    after = dataclasses.replace(
        reached,
        calls=checkpoint.calls + reached.calls,
        selection=checkpoint.selection,
        integrated=checkpoint.integrated or reached.integrated,
        exact=reached.exact or checkpoint.exact,
        linear=checkpoint.linear or reached.linear,
    )
    return responding.decided(after)


def _all(kind: type[P], pieces: Sequence[object]) -> tuple[P, ...]:
    """Return the pieces, all of the one kind that a stage makes."""
    found = tuple(piece for piece in pieces if isinstance(piece, kind))
    if len(found) < len(pieces):
        raise TypeError(f"pieces of another stage: {kind.__name__} is wanted")
    return found


def progress(job: Job, checkpoint: Checkpoint) -> Progress:
    """Tell how far a job is."""
    return checkpoint.stage.progress(job.settings.target_ess)
