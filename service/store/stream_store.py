"""Streams in a database: where each stands, and its last answers."""

import json
import time
from collections.abc import Callable, Sequence
from typing import Any

import sqlalchemy as sa

from service.errors import BusyError
from service.store.stream_record import StreamChange, StreamRecord
from service.store.tables import STREAM, STREAM_ANSWER
from service.store.transactions import Transactions

__all__ = ["StreamStore"]

_LEASE_S = 15.0
_MOST_KEPT = 4 * 2**20
_COLUMNS = tuple(STREAM.c)
# made once: to make a statement takes several times as long as to run it
_id: sa.BindParameter[str] = sa.bindparam("stream")
_old: sa.BindParameter[int] = sa.bindparam("old")
_GET = sa.select(*_COLUMNS).where(STREAM.c.id == _id)
_OF_STREAM = STREAM_ANSWER.c.stream_id == _id
_UP_TO = _OF_STREAM & (STREAM_ANSWER.c.sequence <= _old)
_FREED = sa.select(sa.func.coalesce(sa.func.sum(STREAM_ANSWER.c.size), 0)).where(_UP_TO)
_FORGET = sa.delete(STREAM_ANSWER).where(_UP_TO)
_INSERT = sa.insert(STREAM_ANSWER)
_CHANGE = (
    sa.update(STREAM)
    .where(STREAM.c.id == _id, STREAM.c.number == sa.bindparam("before"))
    .values(
        number=sa.bindparam("after"),
        state=sa.bindparam("state"),
        sequence=sa.bindparam("sequence"),
        counts=sa.bindparam("counts"),
        last=sa.bindparam("last"),
        kept_bytes=STREAM.c.kept_bytes + sa.bindparam("added") - _FREED.scalar_subquery(),
        touched=sa.bindparam("now"),
        holder=sa.bindparam("holder"),
        held_until=sa.bindparam("held_until"),
    )
)
# locked where a database does not lock as a whole
_STAND = (
    sa.select(STREAM.c.id, STREAM.c.number, STREAM.c.kept_bytes)
    .where(STREAM.c.id.in_(sa.bindparam("streams", expanding=True)))
    .order_by(STREAM.c.id)
    .with_for_update()
)
_SIZES = (
    sa.select(STREAM_ANSWER.c.sequence, STREAM_ANSWER.c.size)
    .where(_OF_STREAM)
    .order_by(STREAM_ANSWER.c.sequence.desc())
)
_LESS = (
    sa.update(STREAM)
    .where(STREAM.c.id == _id)
    .values(kept_bytes=STREAM.c.kept_bytes - _FREED.scalar_subquery())
)


def _record(row: sa.Row[Any]) -> StreamRecord:
    fields = dict(row._mapping)
    for name in ("request", "state", "last"):
        fields[name] = bytes(fields[name])
    return StreamRecord(**fields | {"counts": json.loads(fields["counts"])})


class StreamStore:
    """Keeps streams. Every call is atomic, durable when it returns, and may be made in any thread.

    Parameters
    ----------
    database : Transactions
        Where they are kept; every call raises its `StoreError`.
    most : int
        Streams that are kept; half of them of one key.
    idle_s : float
        Time without a line after which a stream has expired, and makes room for others [s].
    keep_s : float
        Time after which it is forgotten [s].
    window : int
        Numbers behind the last one whose answers are kept.
    clock : callable
        Seconds, the same for all processes that share the database.
    """

    def __init__(
        self,
        database: Transactions,
        most: int,
        idle_s: float,
        keep_s: float,
        window: int,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._database = database
        self._most, self._idle_s, self._keep_s = most, idle_s, keep_s
        self._window = window
        self._clock = clock

    def expired(self, record: StreamRecord) -> bool:
        """Tell whether a stream has had no line for too long."""
        return record.touched < self._clock() - self._idle_s

    def held(self, record: StreamRecord) -> bool:
        """Tell whether a client goes on sending to it, by what the row says."""
        return record.holder is not None and record.held_until > self._clock()

    def add(
        self,
        stream_id: str,
        client: str,
        request: bytes,
        state: bytes,
        counts: dict[str, Any] | None = None,
    ) -> StreamRecord:
        """Keep a new stream.

        Raises
        ------
        BusyError
            Where there is no room.
        """
        now = self._clock()
        row = {
            "id": stream_id, "client": client, "request": request, "state": state, "number": 1,
            "sequence": -1, "counts": json.dumps(counts or {}), "last": b"",
            "kept_bytes": 0, "touched": now,
            "held_until": 0.0,
        }  # fmt: skip
        with self._database.write() as connection:
            self._make_room(connection, client, now)
            connection.execute(sa.insert(STREAM).values(**row))
            return _record(
                connection.execute(sa.select(*_COLUMNS).where(STREAM.c.id == stream_id)).one()
            )

    def _make_room(self, connection: sa.Connection, client: str, now: float) -> None:
        """Forget what is too old, and of what has expired the oldest; refuse where all live."""
        connection.execute(sa.delete(STREAM).where(STREAM.c.touched < now - self._keep_s))
        lives = STREAM.c.touched >= now - self._idle_s
        count = sa.select(sa.func.count()).select_from(STREAM)
        own = connection.scalar(count.where(STREAM.c.client == client, lives)) or 0
        if client and own >= max(1, self._most // 2):
            raise BusyError(f"{own} streams of this key are open: delete those that are done")
        surplus = (connection.scalar(count) or 0) - self._most + 1
        if surplus <= 0:
            return
        oldest = (
            sa.select(STREAM.c.arrival).where(~lives).order_by(STREAM.c.touched, STREAM.c.arrival)
        )
        going = connection.scalars(oldest.limit(surplus)).all()
        if len(going) < surplus:
            raise BusyError(f"{self._most} streams are open: delete those that are done")
        connection.execute(sa.delete(STREAM).where(STREAM.c.arrival.in_(going)))

    def get(self, stream_id: str) -> StreamRecord | None:
        """Return a stream as it stands, or None."""
        with self._database.read() as connection:
            row = connection.execute(_GET, {"stream": stream_id}).one_or_none()
        return None if row is None else _record(row)

    def page(self, client: str, after: int | None, limit: int) -> list[StreamRecord]:
        """Return up to ``limit`` streams of a client, newest first, from before ``after``."""
        query = sa.select(*_COLUMNS).where(STREAM.c.client == client)
        if after is not None:
            query = query.where(STREAM.c.arrival < after)
        with self._database.read() as connection:
            rows = connection.execute(query.order_by(STREAM.c.arrival.desc()).limit(limit)).all()
        return [_record(row) for row in rows]

    def count(self) -> int:
        """Return how many streams have not expired."""
        with self._database.read() as connection:
            lives = STREAM.c.touched >= self._clock() - self._idle_s
            count = sa.select(sa.func.count()).select_from(STREAM).where(lives)
            return connection.scalar(count) or 0

    def delete(self, stream_id: str) -> bool:
        """Forget a stream; whether there was one."""
        with self._database.write() as connection:
            gone = connection.execute(sa.delete(STREAM).where(STREAM.c.id == stream_id))
            return bool(gone.rowcount)

    def apply(self, changes: Sequence[StreamChange]) -> list[bool]:
        """Change streams, all in one transaction.

        Parameters
        ----------
        changes : sequence of StreamChange
            In their order, for each stream.

        Returns
        -------
        list of bool
            False where a stream stands elsewhere than where it was seen, or is gone.
        """
        now = self._clock()
        done = [False] * len(changes)
        # in one order everywhere, so that two processes never wait for each other
        left = sorted(range(len(changes)), key=lambda at: changes[at].id)
        with self._database.write() as connection:
            while left:
                first = {changes[at].id: at for at in reversed(left)}
                for at in self._apply(connection, changes, list(first.values())[::-1], now):
                    done[at] = True
                left = [at for at in left if first[changes[at].id] != at]
        return done

    def _apply(
        self,
        connection: sa.Connection,
        changes: Sequence[StreamChange],
        which: Sequence[int],
        now: float,
    ) -> list[int]:
        """Apply some of the changes, of a stream each; which of them still could be."""
        ids = [changes[at].id for at in which]
        stand = {row.id: row for row in connection.execute(_STAND, {"streams": ids}).all()}
        done = [
            at
            for at in which
            if (row := stand.get(changes[at].id)) is not None and row.number == changes[at].number
        ]
        if not done:
            return done
        some = [changes[at] for at in done]
        connection.execute(_CHANGE, [self._row(change, now) for change in some])
        old = [{"stream": c.id, "old": c.sequence - self._window} for c in some]
        connection.execute(_FORGET, old)
        answered = [
            {
                "stream_id": change.id,
                "sequence": change.sequence,
                "size": len(change.answers),
                "bytes": change.answers,
            }
            for change in some
            if change.answers
        ]
        if answered:
            connection.execute(_INSERT, answered)
        for change in some:
            if stand[change.id].kept_bytes + len(change.answers) > _MOST_KEPT:
                self._forget_most(connection, change)
        return done

    def _row(self, change: StreamChange, now: float) -> dict[str, Any]:
        """Return what a change sets, and where."""
        return {
            "stream": change.id,
            "old": change.sequence - self._window,
            "before": change.number,
            "after": change.number + 1,
            "state": change.state,
            "sequence": change.sequence,
            "counts": json.dumps(change.counts),
            "last": change.last,
            "added": len(change.answers),
            "now": now,
            "holder": change.holder,
            "held_until": now + _LEASE_S if change.holder else 0.0,
        }

    @staticmethod
    def _forget_most(connection: sa.Connection, change: StreamChange) -> None:
        """Forget all answers but the last ones that there is room for, and those of the change."""
        total = 0
        for row in connection.execute(_SIZES, {"stream": change.id}).all():
            total += row.size
            if total > _MOST_KEPT and row.sequence < change.sequence:
                old = {"stream": change.id, "old": row.sequence}
                connection.execute(_LESS, old)
                connection.execute(_FORGET, old)
                return

    def release(self, stream_id: str, holder: str) -> None:
        """Let others send to a stream."""
        held = (STREAM.c.id == stream_id, STREAM.c.holder == holder)
        with self._database.write() as connection:
            free = {"holder": None, "held_until": 0.0}
            connection.execute(sa.update(STREAM).where(*held).values(**free))

    def answers(self, stream_id: str) -> list[bytes]:
        """Return the answers of a stream that are kept, of every change, in their order."""
        query = sa.select(STREAM_ANSWER.c.bytes).where(STREAM_ANSWER.c.stream_id == stream_id)
        with self._database.read() as connection:
            found = connection.scalars(query.order_by(STREAM_ANSWER.c.sequence)).all()
        return list(map(bytes, found))
