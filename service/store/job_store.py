"""What the service asks of a store of jobs.

Several processes may share one. A chunk of a job is pure, so that two processes which compute it
come to the same bytes: every write names the checkpoint that it follows, and one that comes second
changes nothing. That a job is held by one process at a time (a lease) saves work and no more.
"""

from collections.abc import Collection
from typing import Any, Protocol

from service.store.record import Claimed, JobRecord, NewJob, Status

__all__ = ["JobStore"]


class JobStore(Protocol):
    """Keeps jobs. Every call is atomic, durable when it returns, and may be made from any thread.

    Every call raises `StoreError` where the store does not answer, is locked or is full; what was
    kept before is kept still.
    """

    def add(self, job: NewJob) -> JobRecord:
        """Keep a new job; return it, or the one that came with the same key before.

        Raises
        ------
        IdempotencyError
            Where the key came with another request.
        BusyError
            Where there is no room.
        """
        ...

    def get(self, job_id: str) -> JobRecord | None:
        """Return a job as it stands, or None."""
        ...

    def page(self, client: str, after: int | None, limit: int) -> list[JobRecord]:
        """Return up to ``limit`` jobs of a client, newest first, from before sequence ``after``."""
        ...

    def counts(self) -> dict[str, int]:
        """Return how many jobs have each status."""
        ...

    def claim(self, holder: str) -> Claimed | None:
        """Take an unfinished job that nobody holds; None where there is none.

        Those to be cancelled come first; then the turn goes round the clients, and among the jobs
        of each. Several processes that claim keep to the same turns.
        """
        ...

    def waits(self) -> bool:
        """Tell whether there is an unfinished job that nobody holds."""
        ...

    def renew(self, holder: str, job_ids: Collection[str]) -> None:
        """Go on holding jobs."""
        ...

    def release(self, holder: str, job_id: str | None = None) -> None:
        """Let go of one job, or of all: another process may take them at once."""
        ...

    def advance(
        self,
        record: JobRecord,
        data: bytes,
        whole: bool,
        progress: dict[str, Any],
        wall_s: float,
        cpu_s: float,
    ) -> JobRecord | None:
        """Keep the next checkpoint; None where another was kept in between, or the job is gone.

        Parameters
        ----------
        record : JobRecord
            The job as it stood when the chunk began.
        data : bytes
            The checkpoint, or what it adds to the last one.
        whole : bool
            Which of the two.
        progress, wall_s, cpu_s
            As in `JobRecord`.
        """
        ...

    def report(self, record: JobRecord, progress: dict[str, Any]) -> JobRecord | None:
        """Change what is told of the progress; None as for `advance`."""
        ...

    def finish(
        self,
        record: JobRecord,
        status: Status,
        result: dict[str, Any] | None,
        problem: dict[str, Any] | None = None,
    ) -> JobRecord | None:
        """End a job; None as for `advance`. The last checkpoint is kept."""
        ...

    def restart(self, record: JobRecord, version: str) -> JobRecord | None:
        """Forget the checkpoints, which are of another format; None as for `advance`."""
        ...

    def cancel(self, job_id: str) -> JobRecord | None:
        """Ask for the end of a job; one that nobody has begun ends at once. None without one."""
        ...

    def delete(self, job_id: str) -> bool:
        """Forget a job; whether there was one."""
        ...

    def drawn(self, job_id: str) -> Claimed | None:
        """Return a job with its last checkpoint, held or not; None without a job."""
        ...

    def sweep(self) -> None:
        """Forget what is older, or more, than is to be kept."""
        ...

    def close(self) -> None:
        """Give connections back."""
        ...
