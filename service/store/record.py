"""What is known of one posterior."""

import dataclasses
from typing import Any, Literal

__all__ = ["FINISHED", "QUEUED", "Claimed", "JobRecord", "NewJob", "Status"]

Status = Literal["queued", "running", "done", "cancelled", "failed"]
FINISHED: frozenset[Status] = frozenset({"done", "cancelled", "failed"})

QUEUED: dict[str, Any] = {
    "phase": "queued",
    "steps": 0,
    "target": None,
    "ess": None,
    "rhat": None,
    "eta_s": None,
}
"""Progress of a job that nobody has begun."""


@dataclasses.dataclass(frozen=True, slots=True)
class NewJob:
    """A job as it is accepted.

    Attributes
    ----------
    id : str
        Public name.
    job : bytes
        The prepared job.
    format : str
        In which it, and what becomes of it, is written.
    method : str
        Sampling method.
    seed : int
        Its seed.
    key, digest : str or None, str
        Idempotency key, and a digest of the request that came with it.
    client : str
        To whom it belongs: the name of an API key, empty where there are none.
    """

    id: str
    job: bytes
    format: str
    method: str
    seed: int
    key: str | None = None
    digest: str = ""
    client: str = ""


@dataclasses.dataclass(frozen=True, slots=True)
class JobRecord:
    """How a posterior stands: a row of a table, without what may be large.

    Attributes
    ----------
    id, format, method, seed, client
        As in `NewJob`.
    sequence : int
        Order of arrival.
    revision : int
        Counts the changes that clients see.
    status : str
        queued, running, done, cancelled or failed.
    cancel_requested : bool
        Whether to stop with what there is.
    number : int
        Of its last checkpoint; 0 before the first.
    progress : dict
        As sent to clients.
    wall_s, cpu_s : float
        Time spent so far [s]: since it was begun, by the processes that held it, and of the
        processor.
    result : dict or None
        The posterior as sent to clients; of a page of jobs it is left out.
    problem : dict or None
        Problem details of a failed one.
    """

    id: str
    format: str
    method: str
    seed: int
    client: str
    sequence: int
    revision: int
    status: Status
    cancel_requested: bool
    number: int
    progress: dict[str, Any]
    wall_s: float
    cpu_s: float
    result: dict[str, Any] | None = None
    problem: dict[str, Any] | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Claimed:
    """A job that one process has taken upon itself.

    Attributes
    ----------
    record : JobRecord
        How it stands.
    job : bytes
        The prepared job.
    pieces : tuple of bytes
        Its last checkpoint: a whole one and what was added since; empty before the first.
    """

    record: JobRecord
    job: bytes
    pieces: tuple[bytes, ...]
