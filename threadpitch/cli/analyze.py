"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli import log_options
from threadpitch.cli.options import AsJson, StartAngles, number, radians
from threadpitch.cli.printing import counting, fail, print_json, printing
from threadpitch.pitch import GroupPitch, StreamedPitch, edge_pitch_table, pitch_table, pitch_tables, stream_pitches
from threadpitch.tables import analysis_document, show_groups
from threadpitch.trace import ColumnChoice, Signals

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
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log."""
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
    with printing():
        if as_json:
            print_json(analysis_document(groups))
        else:
            show_groups(Console(), groups)
