"""Version 1: runs with their pitches."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "1"
down_revision = None


def upgrade() -> None:
    """Make the tables of an empty database."""
    op.create_table(
        "traces",
        sa.Column("sha256", sa.Text, primary_key=True),
        sa.Column("bytes", sa.BigInteger, nullable=False),
    )
    op.create_table(
        "runs",
        sa.Column("number", sa.Integer, primary_key=True, autoincrement=True),
        sa.Column("uid", sa.Text, nullable=False, unique=True),
        *(sa.Column(name, sa.Text, nullable=False) for name in (
            "recorded_at", "kind", "source", "machine", "program", "thread", "serial_number", "note")),
        *(sa.Column(name, sa.Text) for name in ("cause", "sentence", "verdict")),
        sa.Column("provenance", sa.Text, nullable=False),
        sa.Column("trace_sha256", sa.Text, sa.ForeignKey("traces.sha256")),
        sqlite_autoincrement=True,
    )
    op.create_index("runs_by_time", "runs", ["recorded_at"])
    op.create_index("runs_by_serial_number", "runs", ["serial_number"])
    op.create_index("runs_by_trace", "runs", ["trace_sha256"])
    op.create_table(
        "passes",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
        sa.Column("run", sa.Integer, sa.ForeignKey("runs.number", ondelete="CASCADE"), nullable=False),
        sa.Column("place", sa.Integer, nullable=False),
        sa.Column("calculator", sa.Text, nullable=False),
        sa.Column("label", sa.Text, nullable=False),
        sa.Column("target", sa.Double),
        sa.Column("revolutions", sa.Integer, nullable=False),
        sa.Column("turns_before", sa.Integer, nullable=False),
        sa.Column("told", sa.Text, nullable=False),
        sa.Column("notes", sa.Text, nullable=False),
        sa.UniqueConstraint("run", "place"),
    )
    op.create_table(
        "series",
        sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
        sa.Column("pass", sa.Integer, sa.ForeignKey("passes.id", ondelete="CASCADE"), nullable=False),
        sa.Column("place", sa.Integer, nullable=False),
        sa.Column("start_angle", sa.Double, nullable=False),
        sa.Column("extrapolated", sa.Boolean, nullable=False),
        sa.Column("turns", sa.Integer, nullable=False),
        *(sa.Column(name, sa.Double) for name in ("minimum", "maximum", "mean", "standard_deviation")),
        sa.Column("effective_turns", sa.Integer),
        *(sa.Column(f"effective_{name}", sa.Double) for name in ("minimum", "maximum", "mean", "standard_deviation")),
        sa.UniqueConstraint("pass", "place"),
    )
    op.create_table(
        "pitches",
        sa.Column("series", sa.Integer, sa.ForeignKey("series.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("n", sa.Integer, sa.CheckConstraint("n > 0"), primary_key=True),
        sa.Column("pitch", sa.Double, nullable=False),
        sa.Column("uncertainty", sa.Double),
        sa.Column("in_metal", sa.Boolean),
    )
