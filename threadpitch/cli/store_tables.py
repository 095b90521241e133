"""Runs of the store as people read them: a list, one run, several side by side."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from threadpitch.pitch import StreamedPitch
from threadpitch.runs.study import STUDY
from threadpitch.store import RunSummary, SeriesSummary, StoredRun
from threadpitch.store.documents import degrees, series_document
from threadpitch.study_report import show_tables
from threadpitch.tables import MISSING, printable, show_groups
from threadpitch.units import from_si

_FIELDS = {"Recorded": "recorded_at", "Kind": "kind", "Source": "source", "Machine": "machine", "Program": "program",
           "Thread": "thread", "Serial number": "serial_number", "Note": "note", "Verdict": "sentence",
           "Trace": "trace_sha256"}


def show_runs(console: Console, runs: Sequence[RunSummary]) -> None:
    """A line for every run, with the pitches of its last pass: of the turns in the metal, where they are known."""
    lines = []
    for run in runs:
        last = run.main_series
        mean, spread = (math.nan, math.nan) if last is None else (last.best.mean, last.best.standard_deviation)
        lines.append({
            "Run": str(run.number), "Recorded": run.recorded_at.astimezone().strftime("%Y-%m-%d %H:%M"),
            "Machine": run.machine, "Program": run.program, "Thread": run.thread, "Serial": run.serial_number,
            "Mean\n[mm]": _length(mean, "mm", 4), "Spread\n[um]": _length(spread, "um", 2), "Verdict": run.cause or "",
            "Note": run.note,
        })
    told = [heading for heading in lines[0] if any(line[heading] for line in lines)] if lines else []
    table = _table(console, told)
    for line in lines:
        table.add_row(*(_cell(line[heading]) for heading in told))
    if told:
        console.print(table)


def show_run(console: Console, run: StoredRun) -> None:
    """What is known of a run, and its tables."""
    console.print(Text(f"Run {run.summary.number}", style="bold"))
    for name, key in _FIELDS.items():
        value = getattr(run.summary, key)
        if value:
            text = value.astimezone().isoformat(sep=" ", timespec="seconds") if key == "recorded_at" else value
            console.print(Text(f"{name}: {printable(text)}"))
    console.print()
    if run.summary.kind == STUDY:
        analysis = run.provenance.get("analysis", {})
        if "yield_responses" in analysis:  # else it was kept by an older version, which told less
            show_tables(console, analysis)
        return
    show_groups(console, [StreamedPitch(f"{one.label} ({one.calculator})", one.table) for one in run.passes])


def compared(console: Console, runs: Sequence[RunSummary]) -> Table:
    """A row for every run, pass and start angle."""
    table = _table(console, ["Pass", "theta_S\n[deg]", "Run", "Mean\n[mm]", "Less first\n[um]", "Spread\n[um]"])
    for run, one, difference in _compared(runs):
        table.add_row(*map(_cell, (
            f"{one.label} {one.calculator}", f"{degrees(one.start_angle):g}", str(run.number),
            _length(one.best.mean, "mm", 4), _length(difference, "um", 2),
            _length(one.best.standard_deviation, "um", 2))))
    return table


def comparison_document(runs: Sequence[RunSummary]) -> dict[str, object]:
    """The same as JSON."""
    return {"series": [{"run": run.number, **series_document(one),
                        "mean_less_first_um": None if math.isnan(difference) else from_si(difference, "um")}
                       for run, one, difference in _compared(runs)]}


def _compared(runs: Sequence[RunSummary]) -> Iterator[tuple[RunSummary, SeriesSummary, float]]:
    """(run, series, its mean less that of the first run that has it, m), series by series."""
    keys = dict.fromkeys((one.calculator, one.label, one.start_angle) for run in runs for one in run.series)
    for key in keys:
        found = [(run, one) for run in runs for one in run.series
                 if (one.calculator, one.label, one.start_angle) == key]
        yield from ((run, one, one.best.mean - found[0][1].best.mean) for run, one in found)


def _table(console: Console, headings: Sequence[str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD if console.is_terminal else box.ASCII2)
    for heading in headings:
        number = "[" in heading or heading == "Run"
        table.add_column(Text(heading), justify="right" if number else "left", overflow="fold",
                         no_wrap=number or heading in ("Recorded", "Verdict"))
    return table


def _cell(text: str) -> Text:
    return Text(printable(text))  # Text: brackets are no markup


def _length(value: float, unit: str, decimals: int) -> str:
    return MISSING if math.isnan(value) else f"{from_si(value, unit):.{decimals}f}"
