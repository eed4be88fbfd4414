"""The stage in which optional terms are decided, before anything is sampled."""

import dataclasses
from collections.abc import Sequence

from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Job
from inference.posterior.selection.models import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import Selection, decide
from inference.posterior.stages.checkpoint import Checkpoint
from inference.posterior.streams import Stream

__all__ = ["AssessTask", "merge", "sampled", "tasks"]


@dataclasses.dataclass(frozen=True, eq=False)
class AssessTask:
    """One candidate to be assessed.

    Attributes
    ----------
    index : int
        Of the candidate, in the order of `candidate_terms`.
    """

    job: Job
    index: int

    def run(self) -> Candidate:
        """Assess it."""
        terms = candidate_terms(self.job.scene)[self.index]
        job = dataclasses.replace(self.job, scene=reduced(self.job.scene, terms))
        density = job.density()
        fitted = fitted_optima(job, density) if len(density.parameters) else []
        return assess(terms, density, job.stream(Stream.CANDIDATES, self.index), fitted)


def tasks(job: Job) -> tuple[AssessTask, ...]:
    """Return the candidates to be assessed."""
    return tuple(AssessTask(job, k) for k in range(len(candidate_terms(job.scene))))


def merge(job: Job, candidates: Sequence[Candidate]) -> tuple[Selection, int]:
    """Decide which terms stay; return that and the density evaluations it took."""
    selection = Selection(tuple(candidates), decide(job.scene, candidates))
    return selection, sum(candidate.calls for candidate in candidates)


def sampled(job: Job, checkpoint: Checkpoint) -> Job:
    """Return the job as it is sampled: all terms stay until they are decided."""
    job = dataclasses.replace(job, representatives=checkpoint.representatives)
    if not job.scene.optional_terms:
        return job
    selection = checkpoint.selection
    kept = job.scene.optional_terms if selection is None else selection.chosen
    return dataclasses.replace(job, scene=reduced(job.scene, kept))
