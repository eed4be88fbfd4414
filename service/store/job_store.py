"""Jobs in a database: an SQLite file, or PostgreSQL.

Several processes may share one. A chunk of a job is pure, so that two processes which compute it
come to the same bytes: every write names the checkpoint that it follows, and one that comes second
changes nothing. That a job is held by one process at a time (a lease) saves work and no more.
"""

import dataclasses
import time
from collections.abc import Callable, Collection
from typing import Any

import sqlalchemy as sa

from service.store.record import QUEUED, Claimed, JobRecord, NewJob, Status
from service.store.retention import Retention, drop_draws, forget, make_room
from service.store.rows import ALL, BRIEF, claimed, next_free, of_key, one, record_of, text_of
from service.store.tables import CHECKPOINT, JOB, SERVED
from service.store.transactions import Transactions

__all__ = ["JobStore"]

_LEASE_S = 15.0


class JobStore:
    """Keeps jobs. Every call is atomic, durable when it returns, and may be made from any thread.

    Every call raises `StoreError` where the store does not answer, is locked or is full; what was
    kept before is kept still.

    Parameters
    ----------
    url : str
        SQLAlchemy's address of an SQLite file or a PostgreSQL database.
    retention : Retention
        What is kept.
    busy_s : float
        How long to wait for others that write, before saying that the store is locked [s].
    clock : callable
        Seconds, the same for all processes that share the store: a difference costs work that is
        done twice, and nothing else.

    Raises
    ------
    InvalidInputError
        Where the database cannot be used.
    """

    def __init__(
        self,
        url: str,
        retention: Retention,
        busy_s: float = 5.0,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self.database = Transactions(url, busy_s)
        self.engine = self.database.engine
        self._read, self._write = self.database.read, self.database.write
        self._insert = self.database.insert
        self._retention = retention
        self._clock = clock

    def add(self, job: NewJob) -> JobRecord:
        """Keep a new job; return it, or the one that came with the same key before.

        Raises
        ------
        IdempotencyError
            Where the key came with another request.
        BusyError
            Where there is no room.
        """
        with self._write() as connection:
            known = of_key(connection, job)
            if known is not None:
                return known
            make_room(connection, self._retention, job.client)
            row = dataclasses.asdict(job) | {
                "status": "queued",
                "cancel_requested": False,
                "number": 0,
                "revision": 1,
                "progress": text_of(QUEUED),
                "wall_s": 0.0,
                "cpu_s": 0.0,
                "size": 0,
                "held_until": 0.0,
            }
            added = connection.execute(self._insert(JOB).values(row).on_conflict_do_nothing())
            if not added.rowcount:  # on PostgreSQL a key may come twice at a time
                known = of_key(connection, job)
                if known is not None:
                    return known
            return one(connection, job.id)

    def get(self, job_id: str) -> JobRecord | None:
        """Return a job as it stands, or None."""
        with self._read() as connection:
            row = connection.execute(sa.select(*ALL).where(JOB.c.id == job_id)).one_or_none()
        return None if row is None else record_of(row)

    def page(self, client: str, after: int | None, limit: int) -> list[JobRecord]:
        """Return up to ``limit`` jobs of a client, newest first, from before sequence ``after``."""
        query = sa.select(*BRIEF).where(JOB.c.client == client)
        if after is not None:
            query = query.where(JOB.c.sequence < after)
        with self._read() as connection:
            rows = connection.execute(query.order_by(JOB.c.sequence.desc()).limit(limit)).all()
        return [record_of(row) for row in rows]

    def counts(self) -> dict[str, int]:
        """Return how many jobs have each status."""
        query = sa.select(JOB.c.status, sa.func.count()).group_by(JOB.c.status)
        with self._read() as connection:
            return {row.status: row[1] for row in connection.execute(query)}

    def claim(self, holder: str) -> Claimed | None:
        """Take an unfinished job that nobody holds; None where there is none.

        Those to be cancelled come first; then the turn goes round the clients, and among the jobs
        of each. Several processes that claim keep to the same turns.
        """
        now = self._clock()
        with self._read() as connection:
            query = next_free(connection, now)
            if connection.execute(query).first() is None:  # most often: nothing need be locked
                return None
        with self._write() as connection:
            row = connection.execute(query.with_for_update(skip_locked=True, of=JOB)).first()
            if row is None:
                return None
            job_id = row.id
            last = connection.scalar(sa.select(sa.func.max(SERVED.c.turn))) or 0
            served = self._insert(SERVED).values(client=row.client, turn=last + 1)
            connection.execute(
                served.on_conflict_do_update(
                    index_elements=[SERVED.c.client], set_={"turn": last + 1}
                )
            )
            connection.execute(
                sa.update(JOB)
                .where(JOB.c.id == job_id)
                .values(
                    status="running",
                    holder=holder,
                    held_until=now + _LEASE_S,
                    turn=last + 1,
                    revision=JOB.c.revision + 1,
                )
            )
            return claimed(connection, job_id)

    def waits(self) -> bool:
        """Tell whether there is an unfinished job that nobody holds."""
        with self._read() as connection:
            query = next_free(connection, self._clock())
            return connection.execute(query).first() is not None

    def renew(self, holder: str, job_ids: Collection[str]) -> None:
        """Go on holding jobs."""
        held = sa.and_(JOB.c.holder == holder, JOB.c.id.in_(list(job_ids)))
        with self._write() as connection:
            until = self._clock() + _LEASE_S
            connection.execute(sa.update(JOB).where(held).values(held_until=until))

    def release(self, holder: str, job_id: str | None = None) -> None:
        """Let go of one job, or of all: another process may take them at once."""
        held = JOB.c.holder == holder
        if job_id is not None:
            held = sa.and_(held, JOB.c.id == job_id)
        with self._write() as connection:
            free = {"holder": None, "held_until": 0.0}
            connection.execute(sa.update(JOB).where(held).values(**free))

    def _follow(
        self, connection: sa.Connection, record: JobRecord, **values: Any
    ) -> JobRecord | None:
        """Change a running job that stands at the number at which it was seen."""
        same = (JOB.c.id == record.id, JOB.c.number == record.number, JOB.c.status == "running")
        changed = connection.execute(
            sa.update(JOB).where(*same).values(revision=JOB.c.revision + 1, **values)
        )
        return one(connection, record.id) if changed.rowcount else None

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
        number = record.number + 1
        with self._write() as connection:
            after = self._follow(
                connection,
                record,
                number=number,
                progress=text_of(progress),
                wall_s=wall_s,
                cpu_s=cpu_s,
                size=len(data) if whole else JOB.c.size + len(data),
            )
            if after is None:
                return None
            if whole:
                connection.execute(sa.delete(CHECKPOINT).where(CHECKPOINT.c.job_id == record.id))
            row = {"job_id": record.id, "number": number, "bytes": data}
            connection.execute(sa.insert(CHECKPOINT).values(**row))
            return after

    def report(self, record: JobRecord, progress: dict[str, Any]) -> JobRecord | None:
        """Change what is told of the progress; None as for `advance`."""
        with self._write() as connection:
            return self._follow(connection, record, progress=text_of(progress))

    def finish(
        self,
        record: JobRecord,
        status: Status,
        result: dict[str, Any] | None,
        problem: dict[str, Any] | None = None,
    ) -> JobRecord | None:
        """End a job; None as for `advance`. The last checkpoint is kept."""
        # the steps that were made stay; what was foretold has come to an end
        progress = record.progress | {"eta_s": 0.0 if status == "done" else None}
        with self._write() as connection:
            after = self._follow(
                connection,
                record,
                status=status,
                progress=text_of(progress),
                result=text_of(result),
                problem=text_of(problem),
                ended=self._clock(),
                holder=None,
                held_until=0.0,
            )
            drop_draws(connection, self._retention)
            return after

    def restart(self, record: JobRecord, version: str) -> JobRecord | None:
        """Forget the checkpoints, which are of another format; None as for `advance`."""
        with self._write() as connection:
            again = {"number": 0, "format": version, "cpu_s": 0.0, "wall_s": 0.0, "size": 0}
            after = self._follow(connection, record, **again)
            connection.execute(sa.delete(CHECKPOINT).where(CHECKPOINT.c.job_id == record.id))
            return after

    def cancel(self, job_id: str) -> JobRecord | None:
        """Ask for the end of a job; one that nobody has begun ends at once. None without one."""
        seen = {"cancel_requested": True, "revision": JOB.c.revision + 1}
        with self._write() as connection:
            queued = (JOB.c.id == job_id, JOB.c.status == "queued")
            ended = {"status": "cancelled", "ended": self._clock()}
            connection.execute(sa.update(JOB).where(*queued).values(**seen, **ended))
            running = (JOB.c.id == job_id, JOB.c.status == "running")
            connection.execute(
                sa.update(JOB).where(*running, ~JOB.c.cancel_requested).values(**seen)
            )
            row = connection.execute(sa.select(*ALL).where(JOB.c.id == job_id)).one_or_none()
            return None if row is None else record_of(row)

    def delete(self, job_id: str) -> bool:
        """Forget a job; whether there was one."""
        with self._write() as connection:
            return bool(connection.execute(sa.delete(JOB).where(JOB.c.id == job_id)).rowcount)

    def drawn(self, job_id: str) -> Claimed | None:
        """Return a job with its last checkpoint, held or not; None without a job."""
        with self._read() as connection:
            return claimed(connection, job_id)

    def sweep(self) -> None:
        """Forget what is older, or more, than is to be kept."""
        with self._write() as connection:
            forget(connection, self._retention, self._clock())

    def close(self) -> None:
        """Give connections back."""
        self.database.close()
