"""The stage of a posterior in which its optional terms are decided, before anything is sampled."""

import dataclasses

from inference.posterior.fitted import fitted_optima
from inference.posterior.job import Checkpoint, Job
from inference.posterior.sampling.verdict import Verdict
from inference.posterior.selection.candidates import Candidate, assess, candidate_terms, reduced
from inference.posterior.selection.selection import Selection, decide

__all__ = [
    "AssessTask",
    "StartTask",
    "assess_tasks",
    "awaits_start",
    "begin",
    "kept_terms",
    "run_assessment",
    "sampled",
    "take_in",
]

_STREAM = 1000  # random streams of the candidates, apart from those of the sampling


@dataclasses.dataclass(frozen=True, eq=False)
class AssessTask:
    """One candidate to be assessed."""

    job: Job
    index: int


@dataclasses.dataclass(frozen=True, eq=False)
class StartTask:
    """The start of sampling in the scene that was chosen."""

    job: Job


def begin(job: Job) -> Checkpoint:
    """Return the first checkpoint of a job with optional terms."""
    verdict = Verdict(False, ("it was not decided which optional terms stay",))
    return Checkpoint(
        "importance" if job.settings.method == "importance" else "emcee",
        optima=None,
        proposal=None,
        adaptations=0,
        ensembles=(),
        weighted=None,
        calls=0,
        verdict=verdict,
        ess=None,
        r_hat=None,
        finished=False,
        selection=Selection((), ()),
    )


def awaits_start(checkpoint: Checkpoint) -> bool:
    """Tell whether nothing was sampled yet, since optional terms come first."""
    begun = checkpoint.finished or checkpoint.optima is not None
    return checkpoint.selection is not None and not begun


def assess_tasks(job: Job, checkpoint: Checkpoint) -> tuple[AssessTask | StartTask, ...]:
    """Return what is left to do before sampling; nothing where that has begun."""
    if checkpoint.selection is None or not awaits_start(checkpoint):
        return ()
    if checkpoint.selection.decided:
        return (StartTask(sampled(job, checkpoint)),)
    return tuple(AssessTask(job, k) for k in range(len(candidate_terms(job.scene))))


def run_assessment(task: AssessTask) -> Candidate:
    """Assess one candidate."""
    job = task.job
    terms = candidate_terms(job.scene)[task.index]
    job = dataclasses.replace(job, scene=reduced(job.scene, terms))
    density = job.density()
    fitted = fitted_optima(job, density) if len(density.parameters) else []
    return assess(terms, density, job.stream(_STREAM + task.index), fitted)


def take_in(job: Job, checkpoint: Checkpoint, candidates: tuple[Candidate, ...]) -> Checkpoint:
    """Decide which terms stay."""
    selection = Selection(candidates, decide(job.scene, candidates))
    calls = checkpoint.calls + sum(candidate.calls for candidate in candidates)
    verdict = Verdict(False, ("no steps were made",))
    return dataclasses.replace(checkpoint, selection=selection, calls=calls, verdict=verdict)


def kept_terms(job: Job, selection: Selection | None) -> tuple[str, ...]:
    """Return the optional terms that stay: all, where there was no time to decide."""
    if selection is None:
        return ()
    return selection.chosen if selection.decided else job.scene.optional_terms


def sampled(job: Job, checkpoint: Checkpoint) -> Job:
    """Return the job in the scene that was chosen: what is sampled and summarised."""
    if checkpoint.selection is None:
        return job
    scene = reduced(job.scene, kept_terms(job, checkpoint.selection))
    return dataclasses.replace(job, scene=scene)
