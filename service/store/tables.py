"""The tables, as the last migration leaves them."""

import sqlalchemy as sa

__all__ = ["CHECKPOINT", "JOB", "METADATA", "SERVED", "STREAM", "STREAM_ANSWER"]

METADATA = sa.MetaData()

JOB = sa.Table(
    "job",
    METADATA,
    # the order of arrival; 64 bits, but SQLite counts by itself in the type INTEGER alone
    sa.Column("sequence", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), primary_key=True),
    sa.Column("id", sa.String(32), nullable=False, unique=True),
    sa.Column("client", sa.String(64), nullable=False),
    sa.Column("key", sa.String(255)),
    sa.Column("digest", sa.String(64), nullable=False),
    sa.Column("format", sa.String(64), nullable=False),
    sa.Column("method", sa.String(32), nullable=False),
    sa.Column("seed", sa.BigInteger, nullable=False),
    sa.Column("job", sa.LargeBinary, nullable=False),
    sa.Column("status", sa.String(16), nullable=False),
    sa.Column("cancel_requested", sa.Boolean, nullable=False),
    sa.Column("number", sa.Integer, nullable=False),
    sa.Column("revision", sa.Integer, nullable=False),
    sa.Column("progress", sa.Text, nullable=False),
    sa.Column("wall_s", sa.Double, nullable=False),
    sa.Column("cpu_s", sa.Double, nullable=False),
    sa.Column("result", sa.Text),
    sa.Column("problem", sa.Text),
    sa.Column("size", sa.BigInteger, nullable=False),
    sa.Column("ended", sa.Double),
    sa.Column("holder", sa.String(128)),
    sa.Column("held_until", sa.Double, nullable=False),
    sa.Column("turn", sa.BigInteger, nullable=False, server_default="0"),
    sa.UniqueConstraint("client", "key", name="job_client_key"),
    sa.Index("job_status", "status"),
    sqlite_autoincrement=True,
)

SERVED = sa.Table(
    "served",
    METADATA,
    sa.Column("client", sa.String(64), primary_key=True),
    sa.Column("turn", sa.BigInteger, nullable=False),
)

CHECKPOINT = sa.Table(
    "checkpoint",
    METADATA,
    sa.Column(
        "job_id", sa.String(32), sa.ForeignKey("job.id", ondelete="CASCADE"), primary_key=True
    ),
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("bytes", sa.LargeBinary, nullable=False),
)

STREAM = sa.Table(
    "stream",
    METADATA,
    sa.Column("arrival", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), primary_key=True),
    sa.Column("id", sa.String(32), nullable=False, unique=True),
    sa.Column("client", sa.String(64), nullable=False),
    sa.Column("request", sa.LargeBinary, nullable=False),
    sa.Column("number", sa.Integer, nullable=False),
    sa.Column("state", sa.LargeBinary, nullable=False),
    sa.Column("sequence", sa.BigInteger, nullable=False),
    sa.Column("counts", sa.Text, nullable=False),
    sa.Column("last", sa.LargeBinary, nullable=False),
    sa.Column("kept_bytes", sa.BigInteger, nullable=False),
    sa.Column("touched", sa.Double, nullable=False),
    sa.Column("holder", sa.String(128)),
    sa.Column("held_until", sa.Double, nullable=False),
    sa.Index("stream_client", "client"),
    sqlite_autoincrement=True,
)

STREAM_ANSWER = sa.Table(
    "stream_answer",
    METADATA,
    sa.Column(
        "stream_id", sa.String(32), sa.ForeignKey("stream.id", ondelete="CASCADE"), primary_key=True
    ),
    # of the last of its lines
    sa.Column("sequence", sa.BigInteger, primary_key=True),
    sa.Column("size", sa.BigInteger, nullable=False),
    sa.Column("bytes", sa.LargeBinary, nullable=False),
)
