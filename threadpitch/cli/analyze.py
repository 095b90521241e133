"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli import log_options
from threadpitch.cli.judging import Judged, find, findings_document, show_findings
from threadpitch.cli.log_options import LogOptions
from threadpitch.cli.options import AsJson, StartAngles, number, radians
from threadpitch.cli.printing import counting, fail, print_json, printing
from threadpitch.pitch import GroupPitch, StreamedPitch, edge_pitch_table, pitch_table, pitch_tables, stream_pitches
from threadpitch.tables import analysis_document, show_groups

CROSSINGS = {"linear": pitch_table, "edges": edge_pitch_table}


@log_options.with_log_options
def analyze(
    log: Annotated[Path, typer.Argument(
        metavar="LOG", help="Log of a machine: CSV and other text (plain, .gz, or - for standard input), Parquet, "
                            "HDF5, MAT, TDMS, MDF.")],
    of_log: LogOptions,
    index_enable: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="A pass begins where this column falls, and ends with the synchronous motion.")] = None,
    synchronous: Annotated[bool, typer.Option(
        "--synchronous", help="Passes are where the feed moves in step with the spindle (by --target, if given).")]
    = False,
    latency: Annotated[float, typer.Option(
        metavar="MS|estimate", parser=log_options.latency,
        help="The position was recorded so many ms later than the angle.")] = 0.0,
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
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log; with measured pitches, where they come from."""
    screw = of_log.screw_lead if ball_screw is None else ball_screw
    asked = Judged(measured, target, uncertainty, screw, thread, limit, engagement)
    choice = of_log.choice(index_enable)
    signals = of_log.signals(latency=latency, outlier=None if outlier is None else 1e-3 * outlier,
                             synchronous=synchronous, lead=None if target is None else 1e-3 * target)
    whole = signals.needs_the_whole or index_enable is not None or crossing != "linear"
    starts = radians(start_angle or [0.0])
    interval = None if sample_interval is None else math.radians(sample_interval)
    groups: Sequence[GroupPitch | StreamedPitch]
    if crossing not in CROSSINGS:
        fail(f"crossing {crossing!r} is not known; choose {' or '.join(CROSSINGS)}")
    if interval is not None and whole:
        fail("positions stored at an interval are of linear crossings of signals as they are; leave out an option")
    if whole:
        groups = pitch_tables(log, choice, starts, signals, CROSSINGS[crossing])
    else:
        with counting("reading") as told:
            groups = stream_pitches(log, choice, starts, signals, interval=interval, told=told)
    found = find(groups, asked)
    with printing():
        if as_json:
            print_json(analysis_document(groups) | findings_document(found))
        else:
            show_groups(Console(), groups)
            show_findings(Console(), found)
