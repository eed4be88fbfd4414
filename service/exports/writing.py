"""What is made of draws, which are made again from what is stored."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from inference.posterior.answer.draws import Draws
from inference.posterior.job import Job
from service.exports import export_by
from service.exports.described import describe_draws
from service.fold import StoredCheckpoint

__all__ = ["write_draws", "write_file"]

J = TypeVar("J")
C = TypeVar("C", bound=StoredCheckpoint)


def write_draws(
    job_from: Callable[[bytes], J],
    checkpoint_from: Callable[..., C],
    draw: Callable[[J, C], tuple[Job, Draws]],
    write: Callable[[Job, str, Draws], bytes],
    job: bytes,
    pieces: Sequence[bytes],
) -> bytes:
    """Draw again what a checkpoint stands for, and write it: runs in a worker.

    Parameters
    ----------
    job_from, checkpoint_from, draw : callable
        ``Job.from_bytes``, ``Checkpoint.from_bytes`` and ``draw`` of the computation.
    write : callable
        Makes bytes of the job as it was sampled, the method and the draws.
    job, pieces : bytes, sequence of bytes
        As stored.
    """
    at = checkpoint_from(*pieces)
    sampled, draws = draw(job_from(job), at)
    return write(sampled, at.method, draws)


def write_file(media_type: str, job: Job, method: str, draws: Draws) -> bytes:
    """Write draws in the form of a media type, one of `EXPORTS`."""
    return export_by(media_type).write(describe_draws(job, method, draws))
