"""The size of a chunk: counted in evaluations, never timed, so that it is the same everywhere."""

from collections.abc import Mapping
from typing import Literal

from inference.posterior.job import Job
from inference.posterior.sampling.rounds import STEP
from inference.posterior.sampling.scouts import MOST_FRAMES
from inference.posterior.stages.stage import MOST_STEPS

__all__ = [
    "Began",
    "draws_of_rounds",
    "evaluations",
    "is_short_for_scouts",
    "parts_of_a_step",
    "steps_from",
]

Began = Literal["at draws", "warm", "cold"]

_CHUNK_S = 0.33  # half of the longest chunk
_EVALUATION_S = 2.5e-6  # a frame under one parameter vector, for sizing chunks only
_WITH_DISCREPANCY = 10.0  # times as long, where the flux's error is integrated out
_EASIEST = 90  # steps: 50 times of a little more than one, and a burn-in of a fifth
_FIRST: Mapping[Began, int] = {"at draws": 12, "warm": _EASIEST, "cold": 2 * _EASIEST}
_GROWTH = 0.25
_DRAW_S = 2e-4  # of rounds, beside its evaluation: maps are fitted, and other laws are asked
_PARTS = 2  # of a step of rounds that takes long: more would each fit its maps anew
_SCOUTS = 6_000  # density evaluations that scouts take, about
_SHORT = 0.25  # of the time, beyond which they wait
_STEP_S = 5e-4  # of an ensemble, beside its evaluations


def _evaluation_s(job: Job) -> float:
    """Return about how long one parameter vector takes [s]."""
    seconds = job.sampled_frames * _EVALUATION_S
    error = job.scene.model_error
    return seconds * _WITH_DISCREPANCY if error.integrated and error.flux > 0 else seconds


def is_short_for_scouts(job: Job) -> bool:
    """Tell whether scouts may take a large part of the time that there is: they set out last then.

    Otherwise they set out beside other ways of looking for optima.
    """
    seen = min(1.0, MOST_FRAMES / max(job.sampled_frames, 1))
    return _SCOUTS * seen * _evaluation_s(job) > _SHORT * job.settings.max_seconds


def evaluations(job: Job) -> int:
    """Return the density evaluations after which the tempering of a population pauses."""
    return int(3 * _CHUNK_S / _evaluation_s(job))


def draws_of_rounds(job: Job) -> int:
    """Return the draws after which rounds of importance sampling pause."""
    return int(3 * _CHUNK_S / (_evaluation_s(job) + _DRAW_S))


def parts_of_a_step(job: Job) -> int:
    """Return into how many parts the draws of a step of rounds are dealt, to be evaluated."""
    return _PARTS if STEP * _evaluation_s(job) > _CHUNK_S else 1


def steps_from(job: Job, done: int, walkers: int, began: Began) -> int:
    """Return how many steps an ensemble makes in a chunk after those that are done.

    The first ones are what the easiest posterior takes, then it is a share of those that are done:
    what is made beyond need is no more than that.

    Parameters
    ----------
    began : "at draws", "warm" or "cold"
        Where: at draws that could be the answer; near such; anywhere.
    """
    step_s = _STEP_S + walkers * _evaluation_s(job)
    first = _FIRST[began]
    wanted = first if done == 0 else _GROWTH * done
    most = 2 * _CHUNK_S / step_s
    least = min(first, 20)
    return int(min(max(min(wanted, most), least), 500, MOST_STEPS - done))
