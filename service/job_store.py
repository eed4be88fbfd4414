"""Where posteriors are kept between chunks."""

import dataclasses
import threading
from typing import Any, Literal, Protocol

from service.errors import BusyError, IdempotencyError

__all__ = ["FINISHED", "JobRecord", "JobStore", "MemoryJobStore", "Status"]

Status = Literal["queued", "running", "done", "cancelled", "failed"]
FINISHED: frozenset[Status] = frozenset({"done", "cancelled", "failed"})


@dataclasses.dataclass(frozen=True, slots=True)
class JobRecord:
    """All that is known of one posterior: a row of a table, whichever it is kept in.

    Attributes
    ----------
    id : str
        Public name.
    sequence : int
        Order of arrival, given by the store.
    job : bytes
        The prepared job.
    method : str
        Sampling method.
    seed : int
        Its seed.
    key, digest : str or None, str
        Idempotency key, and a digest of the request that came with it.
    status : str
        queued, running, done, cancelled or failed.
    cancel_requested : bool
        Whether to stop at the end of the chunk.
    checkpoint : bytes or None
        State of the fold after the last whole chunk; of a finished job until room is needed.
    progress : dict or None
        As sent to clients.
    wall_s, cpu_s : float
        Time spent so far [s].
    result : dict or None
        The posterior as sent to clients.
    problem : dict or None
        Problem details of a failed one.
    """

    id: str
    job: bytes
    method: str
    seed: int
    key: str | None
    digest: str
    sequence: int = 0
    status: Status = "queued"
    cancel_requested: bool = False
    checkpoint: bytes | None = None
    progress: dict[str, Any] | None = None
    wall_s: float = 0.0
    cpu_s: float = 0.0
    result: dict[str, Any] | None = None
    problem: dict[str, Any] | None = None


class JobStore(Protocol):
    """Keeps records. Every call is atomic, and may be made from any thread."""

    def add(self, record: JobRecord) -> JobRecord:
        """Keep a new record; return it, or the one that came with the same key before.

        Raises
        ------
        IdempotencyError
            Where the key came with another request.
        BusyError
            Where there is no room.
        """
        ...

    def get(self, job_id: str) -> JobRecord | None:
        """Return a record, or None."""
        ...

    def update(self, job_id: str, **changes: Any) -> JobRecord | None:
        """Change fields of a record; return it as it is then, or None where it was deleted."""
        ...

    def delete(self, job_id: str) -> bool:
        """Forget a record; whether there was one."""
        ...

    def page(self, after: int | None, limit: int) -> list[JobRecord]:
        """Return up to ``limit`` records, newest first, that came before sequence ``after``."""
        ...

    def unfinished(self) -> list[JobRecord]:
        """Return the records that are queued or running, in the order of their arrival."""
        ...


class MemoryJobStore:
    """Records in this process's memory.

    Parameters
    ----------
    capacity : int
        Records that are kept; finished ones make room, the oldest first.
    draws_bytes : int
        Bytes of the checkpoints of finished jobs that are kept, from which draws are made; the
        oldest make room.
    """

    def __init__(self, capacity: int, draws_bytes: int = 2**30) -> None:
        self._capacity = capacity
        self._draws_bytes = draws_bytes
        self._lock = threading.Lock()
        self._records: dict[str, JobRecord] = {}
        self._sequence = 0

    def add(self, record: JobRecord) -> JobRecord:
        """See `JobStore.add`."""
        with self._lock:
            if record.key is not None:
                for known in self._records.values():
                    if known.key == record.key:
                        if known.digest != record.digest:
                            raise IdempotencyError("the key came before with another request")
                        return known
            if len(self._records) >= self._capacity:
                self._make_room()
            self._sequence += 1
            kept = dataclasses.replace(record, sequence=self._sequence)
            self._records[kept.id] = kept
            return kept

    def _make_room(self) -> None:
        for known in self._records.values():
            if known.status in FINISHED:
                del self._records[known.id]
                return
        raise BusyError(f"{self._capacity} posteriors are waiting or running")

    def get(self, job_id: str) -> JobRecord | None:
        """See `JobStore.get`."""
        with self._lock:
            return self._records.get(job_id)

    def update(self, job_id: str, **changes: Any) -> JobRecord | None:
        """See `JobStore.update`."""
        with self._lock:
            known = self._records.get(job_id)
            if known is None:
                return None
            changed = dataclasses.replace(known, **changes)
            self._records[job_id] = changed
            if changed.status in FINISHED:
                self._forget_draws()
            return self._records[job_id]

    def _forget_draws(self) -> None:
        kept = 0
        for known in reversed(list(self._records.values())):
            if known.status in FINISHED and known.checkpoint is not None:
                kept += len(known.checkpoint)
                if kept > self._draws_bytes:
                    self._records[known.id] = dataclasses.replace(known, checkpoint=None)

    def delete(self, job_id: str) -> bool:
        """See `JobStore.delete`."""
        with self._lock:
            return self._records.pop(job_id, None) is not None

    def page(self, after: int | None, limit: int) -> list[JobRecord]:
        """See `JobStore.page`."""
        with self._lock:
            newest_first = reversed(self._records.values())
            found = [r for r in newest_first if after is None or r.sequence < after]
        return found[:limit]

    def unfinished(self) -> list[JobRecord]:
        """See `JobStore.unfinished`."""
        with self._lock:
            return [r for r in self._records.values() if r.status not in FINISHED]
