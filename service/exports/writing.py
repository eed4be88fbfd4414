"""Draws made again from what is stored, and written."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from inference.posterior.answer.draws import Draws
from inference.posterior.job import Job
from service.exports import export_by
from service.exports.described import describe_draws
from service.fold import StoredCheckpoint

__all__ = ["write_draws"]

J = TypeVar("J")
C = TypeVar("C", bound=StoredCheckpoint)


def write_draws(
    job_from: Callable[[bytes], J],
    checkpoint_from: Callable[..., C],
    draw: Callable[[J, C], tuple[Job, Draws]],
    media_type: str,
    job: bytes,
    pieces: Sequence[bytes],
) -> bytes:
    """Draw again what a checkpoint stands for, and write it: runs in a worker.

    Parameters
    ----------
    job_from, checkpoint_from, draw : callable
        ``Job.from_bytes``, ``Checkpoint.from_bytes`` and ``draw`` of the computation.
    media_type : str
        Of one of `EXPORTS`.
    job, pieces : bytes, sequence of bytes
        As stored.

    Returns
    -------
    bytes
    """
    at = checkpoint_from(*pieces)
    sampled, draws = draw(job_from(job), at)
    return export_by(media_type).write(describe_draws(sampled, at.method, draws))
