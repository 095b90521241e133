"""The tables of the newest schema; ``migrations`` holds the way to it from every older one.

runs 1 - n passes 1 - n series 1 - n pitches: a pass (or a group of a log) has a series for every start angle, a series
P(n) for every turn. Lengths in m, angles in rad, times as text in UTC, which sorts by itself and is alike in every
database. What is only handed on, never searched, is JSON.
"""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
)

NEWEST = "2"

metadata = MetaData()

traces = Table(
    "traces", metadata,
    Column("sha256", Text, primary_key=True),
    Column("bytes", BigInteger, nullable=False),
)

runs = Table(
    "runs", metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("uid", Text, nullable=False, unique=True),
    Column("recorded_at", Text, nullable=False),
    Column("kind", Text, nullable=False),
    Column("source", Text, nullable=False),
    Column("machine", Text, nullable=False),
    Column("program", Text, nullable=False),
    Column("thread", Text, nullable=False),
    Column("serial_number", Text, nullable=False),
    Column("note", Text, nullable=False),
    Column("cause", Text),
    Column("sentence", Text),
    Column("verdict", Text),  # JSON
    Column("provenance", Text, nullable=False),  # JSON
    Column("trace_sha256", Text, ForeignKey("traces.sha256")),
    Index("runs_by_time", "recorded_at"),
    Index("runs_by_serial_number", "serial_number"),
    Index("runs_by_trace", "trace_sha256"),
    sqlite_autoincrement=True,  # the number of a deleted run is never given again
)

passes = Table(
    "passes", metadata,
    Column("id", Integer, primary_key=True, autoincrement=True),
    Column("run", Integer, ForeignKey("runs.number", ondelete="CASCADE"), nullable=False),
    Column("place", Integer, nullable=False),
    Column("calculator", Text, nullable=False),
    Column("label", Text, nullable=False),
    Column("target", Double),  # m
    Column("revolutions", Integer, nullable=False),
    Column("turns_before", Integer, nullable=False),
    Column("told", Text, nullable=False),  # JSON
    Column("notes", Text, nullable=False),  # JSON
    UniqueConstraint("run", "place"),
)

series = Table(
    "series", metadata,
    Column("id", Integer, primary_key=True, autoincrement=True),
    Column("pass", Integer, ForeignKey("passes.id", ondelete="CASCADE"), nullable=False),
    Column("place", Integer, nullable=False),
    Column("start_angle", Double, nullable=False),  # rad
    Column("extrapolated", Boolean, nullable=False),
    Column("turns", Integer, nullable=False),
    Column("minimum", Double),  # m
    Column("maximum", Double),  # m
    Column("mean", Double),  # m
    Column("standard_deviation", Double),  # m
    Column("effective_turns", Integer),  # of the thread; NULL = not known
    *(Column(f"effective_{name}", Double) for name in ("minimum", "maximum", "mean", "standard_deviation")),
    UniqueConstraint("pass", "place"),
)

pitches = Table(
    "pitches", metadata,
    Column("series", Integer, ForeignKey("series.id", ondelete="CASCADE"), primary_key=True),
    Column("n", Integer, CheckConstraint("n > 0"), primary_key=True),
    Column("pitch", Double, nullable=False),  # m, P(n)
    Column("uncertainty", Double),  # m
    Column("in_metal", Boolean),
)

events = Table(
    "events", metadata,
    Column("sequence", Integer, primary_key=True, autoincrement=False),
    Column("uid", Text, nullable=False, unique=True),
    Column("run", Text, nullable=False),
    Column("kind", Text, nullable=False),
    Column("at", Text, nullable=False),
    Column("document", Text, nullable=False),  # JSON
    Index("events_by_run", "run"),
)

receivers = Table(
    "receivers", metadata,
    Column("name", Text, primary_key=True),
    Column("sequence", Integer, nullable=False),  # of the last event that it has taken
)

identity = Table(
    "identity", metadata,
    Column("uid", Text, primary_key=True),  # of the store: sequences of events are its own
)
