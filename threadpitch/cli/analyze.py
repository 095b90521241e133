"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli import log_options
from threadpitch.cli.options import AsJson, StartAngles, radians
from threadpitch.cli.printing import print_json, printing
from threadpitch.pitch import pitch_tables
from threadpitch.tables import analysis_document, show_groups
from threadpitch.trace import ColumnChoice, Signals


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
    start_angle: StartAngles = None,
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log."""
    choice = ColumnChoice(angle, position, angle_unit, position_unit, group, time, counts_per_turn)
    signals = Signals(angle_wrap, position_wrap, None if screw_lead is None else 1e-3 * screw_lead, gear_ratio,
                      position_counts_per_turn, latency)
    groups = pitch_tables(log, choice, radians(start_angle or [0.0]), signals)
    with printing():
        if as_json:
            print_json(analysis_document(groups))
        else:
            show_groups(Console(), groups)
