"""Jobs as rows of a database."""

import dataclasses
from typing import Any

import orjson
import sqlalchemy as sa

from service.json_text import encode
from service.store.record import Claimed, JobRecord
from service.store.tables import CHECKPOINT, JOB

__all__ = ["ALL", "BRIEF", "claimed", "one", "record_of", "text_of"]

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
