"""A run as a row of a list."""

from __future__ import annotations

import math
from dataclasses import dataclass

from threadpitch.store import RunSummary
from threadpitch.tables import printable
from threadpitch.units import from_si


@dataclass(frozen=True)
class RunRow:
    """What the list shows of a run."""

    number: int
    recorded_at: str
    kind: str
    machine: str
    program: str
    thread: str
    serial_number: str
    note: str
    source: str
    cause: str
    sentence: str
    mean_mm: str
    spread_um: str


def run_row(run: RunSummary) -> RunRow:
    """The run in words; mean and spread are those of its main series."""
    best = None if run.main_series is None else run.main_series.best
    texts = {name: printable(getattr(run, name)) for name in ("kind", "machine", "program", "thread", "serial_number",
                                                             "source")}
    return RunRow(run.number, run.recorded_at.strftime("%Y-%m-%d %H:%M"), note=run.note, cause=run.cause or "-",
                  sentence=printable(run.sentence or ""),
                  mean_mm=_told(None if best is None else best.mean, "mm", 4),
                  spread_um=_told(None if best is None else best.standard_deviation, "um", 2), **texts)


def _told(value: float | None, unit: str, decimals: int) -> str:
    return "-" if value is None or math.isnan(value) else f"{from_si(value, unit):.{decimals}f}"
