"""What goes into the store and comes out of it. SI units; texts as their writers gave them."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.pitch import BoolArray, PitchTable, Statistics, statistics, thread_proper

Document = Mapping[str, Any]  # what JSON holds

LOG, MEASURED = "log", "measured"  # what calculated pitches, where no component of a simulation did
REAL_THREAD = (MEASURED, "actual_pitch")  # what tells of the real thread, in this order


def new_uid() -> str:
    """A name that no other has."""
    return uuid.uuid4().hex


@dataclass(frozen=True, eq=False)
class StoredPass:
    """The pitches of a pass as one calculator saw them, or of a group of a log."""

    calculator: str  # "nominal_pitch", "actual_pitch"; "log", "measured"
    label: str  # group of the log, number of the pass
    table: PitchTable
    target: float | None = None  # m, movement per revolution that was wanted
    in_metal: BoolArray | None = None  # (start_angles, revolutions); None = not known
    told: Document = field(default_factory=dict)  # what the control says of the pass: kind, depth, lead, ...

    @property
    def effective(self) -> Statistics | None:
        """Statistics over the turns of the thread, where they are known."""
        chosen = self.turns_of_thread
        return None if chosen is None else statistics(np.where(chosen, self.table.pitch, np.nan))

    @property
    def turns_of_thread(self) -> BoolArray | None:
        """Those in the metal; where that is not known, of a log those that do not lie far outside at its ends."""
        if self.in_metal is None and self.calculator == LOG:
            return thread_proper(self.table.pitch)
        return self.in_metal


@dataclass(frozen=True, eq=False, kw_only=True)
class NewRun:
    """A run that is to be kept. ``uid`` makes it one: what is added twice under the same uid is there once."""

    kind: str  # "simulation" | "log" | "study"
    source: str
    passes: tuple[StoredPass, ...]
    machine: str = ""
    program: str = ""
    thread: str = ""
    serial_number: str = ""
    note: str = ""
    verdict: Document | None = None
    provenance: Document = field(default_factory=dict)
    trace: Path | None = None  # a whole Parquet file, which is copied
    uid: str = field(default_factory=new_uid)


@dataclass(frozen=True, kw_only=True)
class RunFilter:
    """Which runs are wanted, newest first; None = any."""

    text: str = ""  # part of any text field; upper and lower case are the same
    machine: str | None = None
    program: str | None = None
    thread: str | None = None
    serial_number: str | None = None
    cause: str | None = None
    kind: str | None = None
    since: datetime | None = None
    until: datetime | None = None
    limit: int = 100
    offset: int = 0


@dataclass(frozen=True)
class TurnStatistics:
    """Statistics of P(n) over some turns."""

    turns: int
    minimum: float  # m, NaN without turns
    maximum: float  # m
    mean: float  # m
    standard_deviation: float  # m, of one turn about the mean (n - 1); NaN below two turns


@dataclass(frozen=True)
class SeriesSummary(TurnStatistics):
    """Statistics of P(n) of one pass at one start angle over all turns, and over those in the metal where known."""

    calculator: str
    label: str
    start_angle: float  # rad
    target: float | None  # m
    effective: TurnStatistics | None

    @property
    def best(self) -> TurnStatistics:
        """Over the turns that make the thread, where they are known, else over all."""
        return self if self.effective is None else self.effective


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """A run as lists show it."""

    number: int
    uid: str
    recorded_at: datetime  # UTC
    kind: str
    source: str
    machine: str
    program: str
    thread: str
    serial_number: str
    note: str
    cause: str | None
    sentence: str | None
    trace_sha256: str | None
    series: tuple[SeriesSummary, ...]

    @property
    def main_series(self) -> SeriesSummary | None:
        """What one looks at first: the last pass, of what tells of the real thread where that is there."""
        names = [one.calculator for one in self.series]
        return self.series_of(next((name for name in REAL_THREAD if name in names), names[0])) if names else None

    def series_of(self, calculator: str) -> SeriesSummary | None:
        """The last pass of a calculator, at its first start angle."""
        found = [one for one in self.series if one.calculator == calculator]
        return next((one for one in found if one.label == found[-1].label), None)


@dataclass(frozen=True, eq=False)
class StoredRun:
    """A run with all that the store has of it."""

    summary: RunSummary
    passes: tuple[StoredPass, ...]
    verdict: Document | None
    provenance: Document
    trace: Path | None  # Parquet; None = none was kept


@dataclass(frozen=True, eq=False)
class NewEvent:
    """Something that happened while a machine or a simulation runs: "begin", "revolution", "result"."""

    kind: str
    document: Document  # with units in the key names
    run: str = ""  # uid
    uid: str = field(default_factory=new_uid)


@dataclass(frozen=True, eq=False)
class Event:
    """An event with its place in the order of all: sequences count up by one, without gaps."""

    sequence: int
    uid: str
    run: str
    kind: str
    at: datetime  # UTC
    document: Document


@dataclass(frozen=True)
class Finding:
    """What ``verify`` found: kind "damaged", "missing", "database", or "leftover", which does no harm."""

    kind: str
    what: str

    @property
    def harmless(self) -> bool:
        """A file that an interrupted writer left: no run needs it."""
        return self.kind == "leftover"
