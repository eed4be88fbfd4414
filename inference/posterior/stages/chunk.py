"""The size of a chunk: counted in evaluations, never timed, so that it is the same everywhere."""

from inference.posterior.job import Job
from inference.posterior.sampling.rounds import STEP
from inference.posterior.stages.stage import MOST_STEPS

__all__ = ["draws_of_rounds", "evaluations", "parts_of_a_step", "steps_from"]

_CHUNK_S = 0.33  # half of the longest chunk
_EVALUATION_S = 2.5e-6  # a frame under one parameter vector, for sizing chunks only
_WITH_DISCREPANCY = 10.0  # times as long, where the flux's error is integrated out
_EASIEST = 90  # steps: 50 times of a little more than one, and a burn-in of a fifth
_GROWTH = 0.25
_DRAW_S = 2e-4  # of rounds, beside its evaluation: maps are fitted, and other laws are asked
_PARTS = 2  # of a step of rounds that takes long: more would each fit its maps anew
_STEP_S = 5e-4  # of an ensemble, beside its evaluations


def _evaluation_s(job: Job) -> float:
    """Return about how long one parameter vector takes [s]."""
    seconds = job.sampled_frames * _EVALUATION_S
    error = job.scene.model_error
    return seconds * _WITH_DISCREPANCY if error.integrated and error.flux > 0 else seconds


def evaluations(job: Job) -> int:
    """Return the density evaluations after which the tempering of a population pauses."""
    return int(3 * _CHUNK_S / _evaluation_s(job))


def draws_of_rounds(job: Job) -> int:
    """Return the draws after which rounds of importance sampling pause."""
    return int(3 * _CHUNK_S / (_evaluation_s(job) + _DRAW_S))


def parts_of_a_step(job: Job) -> int:
    """Return into how many parts the draws of a step of rounds are dealt, to be evaluated."""
    return _PARTS if STEP * _evaluation_s(job) > _CHUNK_S else 1


def steps_from(job: Job, done: int, walkers: int, warm: bool) -> int:
    """Return how many steps an ensemble makes in a chunk after those that are done.

    The first ones of a warm start are what the easiest posterior takes, then it is a share of those
    that are done: what is made beyond need is no more than that.
    """
    step_s = _STEP_S + walkers * _evaluation_s(job)
    first = _EASIEST if warm else 2 * _EASIEST
    wanted = first if done == 0 else _GROWTH * done
    most = 2 * _CHUNK_S / step_s
    return int(min(max(min(wanted, most), 20), 500, MOST_STEPS - done))
