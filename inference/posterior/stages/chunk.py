"""The size of a chunk: counted in evaluations, never timed, so that it is the same everywhere."""

from inference.posterior.job import Job
from inference.posterior.sampling.ensemble import WALKERS
from inference.posterior.stages.stage import MOST_STEPS

__all__ = ["evaluations", "steps_from"]

_CHUNK_S = 0.33  # of the first chunk; later ones grow to about a second
_EVALUATION_S = 1.2e-6  # a frame under one parameter vector, for sizing chunks only
_WITH_DISCREPANCY = 10.0  # times as long, where the flux's error is integrated out
_STEP_S = 5e-4  # of an ensemble, beside its evaluations


def _evaluation_s(job: Job) -> float:
    """Return about how long one parameter vector takes [s]."""
    seconds = job.sampled_frames * _EVALUATION_S
    error = job.scene.model_error
    return seconds * _WITH_DISCREPANCY if error.integrated and error.flux > 0 else seconds


def evaluations(job: Job) -> int:
    """Return the density evaluations after which the tempering of a population pauses."""
    return int(3 * _CHUNK_S / _evaluation_s(job))


def steps_from(job: Job, done: int) -> int:
    """Return how many steps an ensemble makes in a chunk after those that are done."""
    step_s = _STEP_S + WALKERS * _evaluation_s(job)
    seconds = _CHUNK_S if done == 0 else 2 * _CHUNK_S
    return int(min(max(seconds / step_s, 20), 500, MOST_STEPS - done))
