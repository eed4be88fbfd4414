"""Jobs in a database: an SQLite file, or PostgreSQL."""

import dataclasses
import time
from collections.abc import Callable, Collection
from typing import Any

import sqlalchemy as sa

from service.errors import IdempotencyError
from service.store.holder import has_ended
from service.store.record import QUEUED, Claimed, JobRecord, NewJob, Status
from service.store.retention import Retention, drop_draws, forget, make_room
from service.store.rows import ALL, BRIEF, claimed, one, record_of, text_of
from service.store.tables import CHECKPOINT, JOB, SERVED
from service.store.transactions import Transactions

__all__ = ["SqlJobStore"]

_LEASE_S = 15.0


class SqlJobStore:
    """See `service.store.job_store.JobStore`.

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
        """See `JobStore.add`."""
        with self._write() as connection:
            known = self._of_key(connection, job)
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
                known = self._of_key(connection, job)
                if known is not None:
                    return known
            return one(connection, job.id)

    @staticmethod
    def _of_key(connection: sa.Connection, job: NewJob) -> JobRecord | None:
        if job.key is None:
            return None
        same = (JOB.c.client == job.client, JOB.c.key == job.key)
        row = connection.execute(sa.select(JOB.c.id, JOB.c.digest).where(*same)).one_or_none()
        if row is None:
            return None
        if row.digest != job.digest:
            raise IdempotencyError("the key came before with another request")
        return one(connection, row.id)

    def get(self, job_id: str) -> JobRecord | None:
        """See `JobStore.get`."""
        with self._read() as connection:
            row = connection.execute(sa.select(*ALL).where(JOB.c.id == job_id)).one_or_none()
        return None if row is None else record_of(row)

    def page(self, client: str, after: int | None, limit: int) -> list[JobRecord]:
        """See `JobStore.page`."""
        query = sa.select(*BRIEF).where(JOB.c.client == client)
        if after is not None:
            query = query.where(JOB.c.sequence < after)
        with self._read() as connection:
            rows = connection.execute(query.order_by(JOB.c.sequence.desc()).limit(limit)).all()
        return [record_of(row) for row in rows]

    def counts(self) -> dict[str, int]:
        """See `JobStore.counts`."""
        query = sa.select(JOB.c.status, sa.func.count()).group_by(JOB.c.status)
        with self._read() as connection:
            return {row.status: row[1] for row in connection.execute(query)}

    def claim(self, holder: str) -> Claimed | None:
        """See `JobStore.claim`."""
        now = self._clock()
        query = self._next(now)
        with self._read() as connection:
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
        """See `JobStore.waits`."""
        query = self._next(self._clock())
        with self._read() as connection:
            return connection.execute(query).first() is not None

    def _next(self, now: float) -> sa.Select[Any]:
        """Return a query for the job whose turn it is, of those that nobody holds."""
        unfinished = JOB.c.status.in_(("queued", "running"))
        with self._read() as connection:
            holders = connection.scalars(
                sa.select(JOB.c.holder).where(unfinished, JOB.c.held_until > now).distinct()
            ).all()
        ended = [name for name in holders if name is not None and has_ended(name)]
        free = sa.or_(JOB.c.held_until <= now, JOB.c.holder.in_(ended))
        turn = sa.func.coalesce(SERVED.c.turn, 0)
        return (
            sa.select(JOB.c.id, JOB.c.client)
            .outerjoin(SERVED, SERVED.c.client == JOB.c.client)
            .where(unfinished, free)
            .order_by(JOB.c.cancel_requested.desc(), turn, JOB.c.turn, JOB.c.sequence)
            .limit(1)
        )

    def renew(self, holder: str, job_ids: Collection[str]) -> None:
        """See `JobStore.renew`."""
        held = sa.and_(JOB.c.holder == holder, JOB.c.id.in_(list(job_ids)))
        with self._write() as connection:
            until = self._clock() + _LEASE_S
            connection.execute(sa.update(JOB).where(held).values(held_until=until))

    def release(self, holder: str, job_id: str | None = None) -> None:
        """See `JobStore.release`."""
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
        """See `JobStore.advance`."""
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
        """See `JobStore.report`."""
        with self._write() as connection:
            return self._follow(connection, record, progress=text_of(progress))

    def finish(
        self,
        record: JobRecord,
        status: Status,
        result: dict[str, Any] | None,
        problem: dict[str, Any] | None = None,
    ) -> JobRecord | None:
        """See `JobStore.finish`."""
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
        """See `JobStore.restart`."""
        with self._write() as connection:
            again = {"number": 0, "format": version, "cpu_s": 0.0, "wall_s": 0.0, "size": 0}
            after = self._follow(connection, record, **again)
            connection.execute(sa.delete(CHECKPOINT).where(CHECKPOINT.c.job_id == record.id))
            return after

    def cancel(self, job_id: str) -> JobRecord | None:
        """See `JobStore.cancel`."""
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
        """See `JobStore.delete`."""
        with self._write() as connection:
            return bool(connection.execute(sa.delete(JOB).where(JOB.c.id == job_id)).rowcount)

    def drawn(self, job_id: str) -> Claimed | None:
        """See `JobStore.drawn`."""
        with self._read() as connection:
            return claimed(connection, job_id)

    def sweep(self) -> None:
        """See `JobStore.sweep`."""
        with self._write() as connection:
            forget(connection, self._retention, self._clock())

    def close(self) -> None:
        """See `JobStore.close`."""
        self.database.close()
