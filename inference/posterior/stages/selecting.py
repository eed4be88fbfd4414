"""The stage in which optional terms are decided, before anything is sampled."""

import dataclasses
from collections.abc import Sequence

from inference.posterior.job import Job
from inference.posterior.sampling.start import Optimum, refine
from inference.posterior.selection.models import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import Selection, decide
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.stages.looking import (
    Looked,
    LookTask,
    ShapeTask,
    looking,
    taken_in,
    ways_left,
)
from inference.posterior.stages.optima import that_matter
from inference.posterior.stages.stage import Selecting, Starting
from inference.posterior.streams import Stream

__all__ = ["AssessTask", "begun", "decided", "looked", "sampled", "tasks"]


@dataclasses.dataclass(frozen=True, eq=False)
class AssessTask:
    """One candidate to be assessed.

    Attributes
    ----------
    job : Job
        With the candidate's terms, none of them optional.
    terms : tuple of str
        Which optional terms it keeps.
    index : int
        Of the candidate, in the order of `candidate_terms`.
    found : tuple of Optimum
        Its optima; of a large job those of some of the frames.
    """

    job: Job
    terms: tuple[str, ...]
    index: int
    found: tuple[Optimum, ...]

    def run(self) -> Candidate:
        """Assess it."""
        density, found = self.job.density(), list(self.found)
        if self.job.is_large:
            refined = [refine(density, optimum.z) for optimum in found]
            found = [optimum for optimum in refined if optimum is not None]
        return assess(self.terms, density, self.job.stream(Stream.CANDIDATES, self.index), found)


def begun(job: Job) -> Selecting:
    """Return the stage before its first step: no optima to be looked for where all is known."""
    jobs = [_candidate(job, terms) for terms in candidate_terms(job.scene)]
    done = Starting(fitted=(), climbed=())
    return Selecting(tuple(Starting() if len(each.density().parameters) else done for each in jobs))


def _candidate(job: Job, terms: Sequence[str]) -> Job:
    """Return the job with some of its optional terms, and without the others."""
    return dataclasses.replace(job, scene=reduced(job.scene, terms))


def tasks(job: Job, stage: Selecting) -> tuple[LookTask | ShapeTask, ...] | tuple[AssessTask, ...]:
    """Return the ways to look for the optima of all candidates; then these, to be assessed.

    Parameters
    ----------
    job : Job
        With its optional terms.
    stage : Selecting
        How far each candidate is.
    """
    every = candidate_terms(job.scene)
    jobs = [_candidate(job, terms) for terms in every]
    each = (looking(j, s, scouts=False) for j, s in zip(jobs, stage.starts, strict=True))
    left = tuple(task for some in each for task in some)
    return left or tuple(
        AssessTask(jobs[k], terms, k, tuple(that_matter(stage.starts[k].optima)))
        for k, terms in enumerate(every)
    )


def looked(stage: Selecting, found: Sequence[Looked]) -> tuple[Selecting, int]:
    """Take in the optima that candidates were found to have.

    Parameters
    ----------
    stage : Selecting
        Before.
    found : sequence of Looked
        What every way led to, in the order of `tasks`.

    Returns
    -------
    (Selecting, int)
        And the density evaluations on the way to it.
    """
    rest, starts, calls = list(found), [], 0
    for start in stage.starts:
        left = len(ways_left(start, scouts=False))
        new, used = taken_in(start, rest[:left])
        rest, calls = rest[left:], calls + used
        starts.append(new)
    return Selecting(tuple(starts)), calls


def decided(
    job: Job, stage: Selecting, candidates: Sequence[Candidate]
) -> tuple[Selection, Starting, int]:
    """Decide which terms stay; return that, the start of their scene and the evaluations."""
    selection = Selection(tuple(candidates), decide(job.scene, candidates))
    chosen = candidate_terms(job.scene).index(selection.chosen)
    return selection, stage.starts[chosen], sum(candidate.calls for candidate in candidates)


def sampled(job: Job, checkpoint: Checkpoint) -> Job:
    """Return the job as it is sampled: all terms stay until they are decided."""
    job = dataclasses.replace(job, representatives=checkpoint.representatives)
    if checkpoint.integrated:
        job = job.with_error_integrated()
    if not job.scene.optional_terms:
        return job
    selection = checkpoint.selection
    kept = job.scene.optional_terms if selection is None else selection.chosen
    return dataclasses.replace(job, scene=reduced(job.scene, kept))
