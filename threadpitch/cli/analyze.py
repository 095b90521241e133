"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli.following_error import recorded_control
from threadpitch.cli.judging import Findings, Judged, find, findings_document, show_findings
from threadpitch.cli.kept import Keeper, keeping_run, stored_line
from threadpitch.cli.log_options import Latency, LogOptions, Outlier
from threadpitch.cli.option_records import with_option_records
from threadpitch.cli.options import (
    OF_THREAD,
    WITHOUT_MEASURED,
    WITHOUT_THREAD,
    AsJson,
    StartAngles,
    number,
    radians,
    refuse,
)
from threadpitch.cli.printing import ReadingLine, fail, print_json, printing
from threadpitch.cli.store_options import NOT_KEPT, KeepOptions, refuse_labels_of_nothing
from threadpitch.pitch import GroupPitch, StreamedPitch, edge_pitch_table, pitch_table, pitch_tables, stream_pitches
from threadpitch.tables import analysis_document, show_groups
from threadpitch.trace import ColumnChoice, Signals

CROSSINGS = {"linear": pitch_table, "edges": edge_pitch_table}


_OF_MEASURED = ("uncertainty", "negligible", "ball_screw", "lead_change", "following_error", "expected_lag")


@with_option_records
def analyze(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(
        metavar="LOG", help="Log of a machine: CSV and other text (plain, .gz, or - for standard input), Parquet, "
                            "HDF5, MAT, TDMS, MDF.")],
    of_log: LogOptions,
    latency: Latency = 0.0,
    outlier: Outlier = None,
    sample_interval: Annotated[float | None, typer.Option(
        metavar="DEG", parser=number, help="P(n) out of positions stored at every multiple of this angle.")] = None,
    crossing: Annotated[str, typer.Option(
        metavar="linear|edges", help="How xi at a crossing is found: interpolated between two samples, or by the edges "
                                     "of a quantised angle, with a standard uncertainty.")] = "linear",
    start_angle: StartAngles = None,
    measured: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Measured pitches, CSV with turn or position, pitch and, where known, flank, "
                             "start_angle_deg, uncertainty_um: judged against the last group.")] = None,
    target: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Movement per revolution that was wanted.", show_default="of --thread")]
    = None,
    lead_change: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="What the lead changes by in every turn, from --target at the first sample "
                                          "on (the K or R of G34, with its sign); with --measured.")] = None,
    uncertainty: Annotated[float | None, typer.Option(
        metavar="UM", parser=number, help="Standard uncertainty of one measured pitch.")] = None,
    negligible: Annotated[float | None, typer.Option(
        metavar="UM", parser=number, help="Deviation of one pitch that does not matter: a cause is called absent only "
                                          "where it surely makes no larger one.",
        show_default="what is sure to be found, 5 to 6 uncertainties")] = None,
    ball_screw: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Lead of the feed's ball screw, to know its turns again in the rest.",
        show_default="--screw-lead")] = None,
    thread: Annotated[str | None, typer.Option(
        metavar="DESIGNATION", help="M20x1.5-6g, M20x3(P1.5)-6H, 1/4-20 UNC-2A: pitch deviations against its "
                                    "tolerance.")] = None,
    limit: Annotated[float, typer.Option(
        metavar="PERCENT", parser=number, help="Share of the pitch-diameter tolerance that they may take.")] = 25.0,
    engagement: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Length over which they add up.", show_default="longest normal one")] = None,
    following_error: Annotated[str | None, typer.Option(
        metavar="COLUMN|none", help="Column of the following error, command less position, in the position's unit: "
                                    "for where in the control, with --measured.",
        show_default="by its name, or from the commanded position")] = None,
    expected_lag: Annotated[float | None, typer.Option(
        metavar="MS", parser=number, help="(1 - feedforward)/Kv + Td of the feed drive, which the lag that is found in "
                                          "the log is compared with.")] = None,
    keep: KeepOptions = NOT_KEPT,
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log; with measured pitches, where they come from."""
    if measured is None:
        refuse(context, _OF_MEASURED, WITHOUT_MEASURED)
    if thread is None:
        refuse(context, OF_THREAD, WITHOUT_THREAD)
    refuse_labels_of_nothing(context)
    screw = of_log.screw_lead if ball_screw is None else ball_screw
    asked = Judged(measured, target, uncertainty, screw, thread, limit, engagement, expected_lag, negligible,
                   lead_change)
    choice = of_log.choice()
    signals = of_log.signals(target, latency=latency, outlier=None if outlier is None else 1e-3 * outlier)
    starts = radians(start_angle or [0.0])
    interval = None if sample_interval is None else math.radians(sample_interval)
    if crossing not in CROSSINGS:
        fail(f"crossing {crossing!r} is not known; choose {' or '.join(CROSSINGS)}")
    reading = Reading(log, choice, signals, tuple(starts), interval, crossing)
    if interval is not None and (reading.whole or crossing != "linear"):
        fail("positions stored at an interval are of linear crossings of signals as they are; leave out an option")
    kept = keep.asked(thread=thread or "")
    with keeping_run(kept, "log", str(log)) as keeper:
        groups = _groups(reading, keeper)
        found = find(groups, asked, lambda: recorded_control(log, choice, signals, following_error))
        stored: dict[str, object] = {}
        try:
            if keeper is not None:
                stored = keeper.finish_log(groups, found, reading.described())
        finally:  # what was found is told, whatever becomes of the store
            _show(Shown(groups, found, stored), as_json)


@dataclass(frozen=True)
class Reading:
    """How a log is read."""

    log: Path
    choice: ColumnChoice
    signals: Signals
    start_angles: tuple[float, ...]  # rad
    interval: float | None  # rad
    crossing: str

    @property
    def whole(self) -> bool:
        """Whether the log must be in memory."""
        return self.signals.needs_the_whole

    def described(self) -> dict[str, object]:
        """As JSON, SI."""
        return {"choice": asdict(self.choice), "signals": asdict(self.signals), "start_angles": self.start_angles,
                "sample_interval": self.interval, "crossing": self.crossing}


def _groups(reading: Reading, keeper: Keeper | None) -> Sequence[GroupPitch | StreamedPitch]:
    log, choice, starts, signals = reading.log, reading.choice, reading.start_angles, reading.signals
    if reading.whole:
        with ReadingLine("reading") as line:
            found = pitch_tables(log, choice, starts, signals, CROSSINGS[reading.crossing], told=line.told,
                                 read=line.read)
        if keeper is not None:
            for group in found:
                keeper.sample(group.label, group.trace)
        return found
    with ReadingLine("reading") as line:
        return stream_pitches(log, choice, starts, signals, interval=reading.interval,
                              edges=reading.crossing == "edges", told=line.told, read=line.read,
                              taken=None if keeper is None else keeper.sample)


@dataclass(frozen=True)
class Shown:
    """What is printed of a log."""

    groups: Sequence[GroupPitch | StreamedPitch]
    found: Findings
    stored: dict[str, object]


def _show(shown: Shown, as_json: bool) -> None:
    with printing():
        if as_json:
            print_json(analysis_document(shown.groups) | findings_document(shown.found) | shown.stored)
        else:
            show_groups(Console(), shown.groups, target=shown.found.target)
            show_findings(Console(), shown.found)
            if shown.stored:
                print(stored_line(shown.stored))
