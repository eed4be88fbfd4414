"""Turns: which job, and whose, was worked on last."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add them; jobs that are there have had none."""
    op.add_column("job", sa.Column("turn", sa.BigInteger, nullable=False, server_default="0"))
    op.create_table(
        "served",
        sa.Column("client", sa.String(64), primary_key=True),
        sa.Column("turn", sa.BigInteger, nullable=False),
    )


def downgrade() -> None:
    """Drop them."""
    op.drop_table("served")
    op.drop_column("job", "turn")
