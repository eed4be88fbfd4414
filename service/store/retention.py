"""What is kept of jobs that have ended, and what is forgotten."""

import dataclasses

import sqlalchemy as sa

from service.errors import BusyError
from service.store.record import FINISHED
from service.store.tables import CHECKPOINT, JOB

__all__ = ["Retention", "drop_draws", "forget", "make_room"]


@dataclasses.dataclass(frozen=True, slots=True)
class Retention:
    """What is kept of jobs that have ended; the oldest go first.

    Attributes
    ----------
    jobs : int
        Jobs, unfinished ones included.
    draws_bytes : int
        Bytes of the checkpoints of finished jobs, from which draws are made.
    age_s : float
        Seconds since the end.
    """

    jobs: int
    draws_bytes: int = 2**30
    age_s: float = 30 * 86_400.0


def make_room(connection: sa.Connection, retention: Retention, client: str) -> None:
    """Forget what has ended of the client that has most; refuse one that fills half of it all.

    Where there are no keys there is one client, which may fill it all.

    Raises
    ------
    BusyError
        Where there is no room.
    """
    waiting = (JOB.c.client == client, JOB.c.ended.is_(None))
    own = connection.scalar(sa.select(sa.func.count()).select_from(JOB).where(*waiting)) or 0
    if client and own >= max(1, retention.jobs // 2):
        raise BusyError(f"{own} posteriors of this key are waiting or running")
    count = connection.scalar(sa.select(sa.func.count()).select_from(JOB)) or 0
    surplus = count - retention.jobs + 1
    if surplus <= 0:
        return
    counts = sa.select(JOB.c.client, sa.func.count().label("jobs")).group_by(JOB.c.client)
    most = counts.subquery()
    oldest = (
        sa.select(JOB.c.sequence)
        .join(most, most.c.client == JOB.c.client)
        .where(JOB.c.ended.is_not(None))
        .order_by(most.c.jobs.desc(), JOB.c.sequence)
    )
    going = connection.scalars(oldest.limit(surplus)).all()
    if len(going) < surplus:
        raise BusyError(f"{retention.jobs} posteriors are waiting or running")
    connection.execute(sa.delete(JOB).where(JOB.c.sequence.in_(going)))


def forget(connection: sa.Connection, retention: Retention, now: float) -> None:
    """Forget what is older, or more, than is to be kept."""
    connection.execute(sa.delete(JOB).where(JOB.c.ended < now - retention.age_s))
    drop_draws(connection, retention)


def drop_draws(connection: sa.Connection, retention: Retention) -> None:
    """Forget the checkpoints of the oldest jobs that have ended, where they are too many."""
    finished = JOB.c.status.in_(sorted(FINISHED))
    sizes = connection.execute(
        sa.select(JOB.c.id, JOB.c.size)
        .where(finished, JOB.c.size > 0)
        .order_by(JOB.c.sequence.desc())
    ).all()
    kept, going = 0, []
    for job_id, size in sizes:
        kept += size
        if kept > retention.draws_bytes:
            going.append(job_id)
    if going:
        gone = CHECKPOINT.c.job_id.in_(going)
        connection.execute(sa.delete(CHECKPOINT).where(gone))
        connection.execute(sa.update(JOB).where(JOB.c.id.in_(going)).values(size=0))
