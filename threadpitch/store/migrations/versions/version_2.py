"""Version 2: events in one order, how far each receiver has taken them, and whose they are."""

from __future__ import annotations

import uuid

import sqlalchemy as sa
from alembic import op

revision = "2"
down_revision = "1"


def upgrade() -> None:
    """Add the tables of events."""
    op.create_table(
        "events",
        sa.Column("sequence", sa.Integer, primary_key=True, autoincrement=False),
        sa.Column("uid", sa.Text, nullable=False, unique=True),
        *(sa.Column(name, sa.Text, nullable=False) for name in ("run", "kind", "at", "document")),
    )
    op.create_index("events_by_run", "events", ["run"])
    op.create_table(
        "receivers",
        sa.Column("name", sa.Text, primary_key=True),
        sa.Column("sequence", sa.Integer, nullable=False),
    )
    identity = op.create_table("identity", sa.Column("uid", sa.Text, primary_key=True))
    op.bulk_insert(identity, [{"uid": uuid.uuid4().hex}])
