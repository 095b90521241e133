"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli import log_options
from threadpitch.cli.judging import Judged, find, findings_document, show_findings
from threadpitch.cli.options import AsJson, StartAngles, number, radians
from threadpitch.cli.printing import counting, fail, print_json, printing
from threadpitch.judgement import ControlTrace, JudgementError
from threadpitch.pitch import GroupPitch, StreamedPitch, edge_pitch_table, pitch_table, pitch_tables, stream_pitches
from threadpitch.tables import analysis_document, show_groups
from threadpitch.trace import ColumnChoice, Signals, read_groups
from threadpitch.trace.text_rows import STANDARD_INPUT

CROSSINGS = {"linear": pitch_table, "edges": edge_pitch_table}


def analyze(
    log: Annotated[Path, typer.Argument(
        metavar="LOG", help="Log of a machine: CSV and other text (plain, .gz, or - for standard input), Parquet, "
                            "HDF5, MAT, TDMS, MDF.")],
    angle: log_options.Angle = None,
    position: log_options.Position = None,
    angle_unit: log_options.AngleUnit = None,
    position_unit: log_options.PositionUnit = None,
    counts_per_turn: log_options.CountsPerTurn = None,
    group: log_options.GroupColumn = None,
    time: log_options.TimeColumn = None,
    angle_wrap: log_options.AngleWrap = None,
    position_wrap: log_options.PositionWrap = 0.0,
    screw_lead: log_options.ScrewLead = None,
    gear_ratio: log_options.GearRatio = 1.0,
    position_counts_per_turn: log_options.PositionCounts = None,
    latency: log_options.Latency = 0.0,
    outlier: Annotated[float | None, typer.Option(
        metavar="MM", parser=number,
        help="Put single positions that stick out by more than this between their neighbours.")] = None,
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
    uncertainty: Annotated[float | None, typer.Option(
        metavar="UM", parser=number, help="Standard uncertainty of one measured pitch.")] = None,
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
        metavar="COLUMN", help="Column of the following error, command less position, in the position's unit: for "
                               "where in the control, with --measured.")] = None,
    expected_lag: Annotated[float | None, typer.Option(
        metavar="MS", parser=number, help="(1 - feedforward)/Kv + Td of the feed drive, which the lag that is found in "
                                          "the log is compared with.")] = None,
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log; with measured pitches, where they come from."""
    asked = Judged(measured, target, uncertainty, screw_lead if ball_screw is None else ball_screw, thread, limit,
                   engagement, expected_lag)
    choice = ColumnChoice(angle, position, angle_unit, position_unit, group, time, counts_per_turn)
    signals = Signals(angle_wrap, position_wrap, None if screw_lead is None else 1e-3 * screw_lead, gear_ratio,
                      position_counts_per_turn, latency, None if outlier is None else 1e-3 * outlier)
    starts = radians(start_angle or [0.0])
    interval = None if sample_interval is None else math.radians(sample_interval)
    groups: Sequence[GroupPitch | StreamedPitch]
    if crossing not in CROSSINGS:
        fail(f"crossing {crossing!r} is not known; choose {' or '.join(CROSSINGS)}")
    if interval is not None and (crossing != "linear" or signals.needs_the_whole):
        fail("positions stored at an interval are of linear crossings of signals as they are; leave out an option")
    if signals.needs_the_whole or crossing != "linear":
        groups = pitch_tables(log, choice, starts, signals, CROSSINGS[crossing])
    else:
        with counting("reading") as told:
            groups = stream_pitches(log, choice, starts, signals, interval=interval, told=told)
    found = find(groups, asked, lambda: _recording(log, choice, signals, following_error))
    with printing():
        if as_json:
            print_json(analysis_document(groups) | findings_document(found))
        else:
            show_groups(Console(), groups)
            show_findings(Console(), found)


def _recording(log: Path, choice: ColumnChoice, signals: Signals, following_error: str | None) -> ControlTrace:
    """The last group of the log once more, whole, with its following error where a column is named.

    Raises:
        JudgementError: the log can be read only once.
        TraceError: the column is not there.
    """
    if str(log) == STANDARD_INPUT:
        raise JudgementError("a log on standard input can be read only once; give a file")
    trace = read_groups(log, choice, signals)[-1]
    if following_error is None:
        return ControlTrace(trace)
    beside = read_groups(log, replace(choice, position=following_error), signals)[-1]
    return ControlTrace(trace, following_error=beside.position)
