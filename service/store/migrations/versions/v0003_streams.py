"""Streams, and their last answers."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Make the tables."""
    op.create_table(
        "stream",
        sa.Column(
            "arrival", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), primary_key=True
        ),
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
        sqlite_autoincrement=True,
    )
    op.create_index("stream_client", "stream", ["client"])
    op.create_table(
        "stream_answer",
        sa.Column(
            "stream_id",
            sa.String(32),
            sa.ForeignKey("stream.id", ondelete="CASCADE"),
            primary_key=True,
        ),
        sa.Column("sequence", sa.BigInteger, primary_key=True),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("bytes", sa.LargeBinary, nullable=False),
    )


def downgrade() -> None:
    """Drop the tables."""
    op.drop_table("stream_answer")
    op.drop_table("stream")
