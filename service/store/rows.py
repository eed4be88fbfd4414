"""Jobs as rows of a database."""

import dataclasses
from typing import Any

import orjson
import sqlalchemy as sa

from service.errors import IdempotencyError
from service.json_text import encode
from service.store.holder import has_ended
from service.store.record import Claimed, JobRecord, NewJob
from service.store.tables import CHECKPOINT, JOB, SERVED

__all__ = ["ALL", "BRIEF", "claimed", "next_free", "of_key", "one", "record_of", "text_of"]

BRIEF = tuple(
    JOB.c[field.name]
    for field in dataclasses.fields(JobRecord)
    if field.name not in ("result", "problem")
)
"""Columns of a job in a list."""

ALL = (*BRIEF, JOB.c.result, JOB.c.problem)
"""Columns of a job by itself."""


def text_of(value: dict[str, Any] | None) -> str | None:
    """Return a value as the text of a column."""
    return None if value is None else encode(value).decode()


def record_of(row: sa.Row[Any]) -> JobRecord:
    """Return the job of a row of `ALL` or `BRIEF`."""
    fields = dict(row._mapping)
    for name in ("progress", "result", "problem"):
        if fields.get(name) is not None:
            fields[name] = orjson.loads(fields[name])
    return JobRecord(**fields)


def one(connection: sa.Connection, job_id: str) -> JobRecord:
    """Return a job that is there."""
    return record_of(connection.execute(sa.select(*ALL).where(JOB.c.id == job_id)).one())


def claimed(connection: sa.Connection, job_id: str) -> Claimed | None:
    """Return a job with what it was asked and what it has drawn; None where there is none."""
    row = connection.execute(sa.select(*ALL).where(JOB.c.id == job_id)).one_or_none()
    job = connection.scalar(sa.select(JOB.c.job).where(JOB.c.id == job_id))
    if row is None or job is None:
        return None
    pieces = connection.scalars(
        sa.select(CHECKPOINT.c.bytes)
        .where(CHECKPOINT.c.job_id == job_id)
        .order_by(CHECKPOINT.c.number)
    ).all()
    held = tuple(bytes(piece) for piece in pieces)
    return Claimed(record_of(row), bytes(job), held)


def of_key(connection: sa.Connection, job: NewJob) -> JobRecord | None:
    """Return the job that came with the same key before, or None.

    Raises
    ------
    IdempotencyError
        Where the key came with another request.
    """
    if job.key is None:
        return None
    same = (JOB.c.client == job.client, JOB.c.key == job.key)
    row = connection.execute(sa.select(JOB.c.id, JOB.c.digest).where(*same)).one_or_none()
    if row is None:
        return None
    if row.digest != job.digest:
        raise IdempotencyError("the key came before with another request")
    return one(connection, row.id)


def next_free(connection: sa.Connection, now: float) -> sa.Select[Any]:
    """Return a query for the job whose turn it is, of those that nobody holds."""
    unfinished = JOB.c.status.in_(("queued", "running"))
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
