"""``threadpitch analyze``: movement per revolution in a machine's log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli.judging import Judged, find, findings_document, show_findings
from threadpitch.cli.options import AsJson, StartAngles, number, radians
from threadpitch.cli.printing import print_json, printing
from threadpitch.pitch import pitch_tables
from threadpitch.tables import analysis_document, show_groups
from threadpitch.trace import ColumnChoice


def analyze(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a machine: CSV, plain or .gz.")],
    angle: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the spindle's angle.")],
    position: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the feed's position.")],
    angle_unit: Annotated[str, typer.Option(metavar="rev|deg|rad|count", help="Unit of the angle.")] = "rev",
    position_unit: Annotated[str, typer.Option(metavar="mm|m|um|inch", help="Unit of the position.")] = "mm",
    counts_per_turn: Annotated[float | None, typer.Option(
        metavar="N", parser=number,
        help="Counts per turn, for --angle-unit count: lines of the encoder times 4.")] = None,
    group: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column that parts the passes; rows with 0, false or nothing in it are left out.")]
    = None,
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of the time.", show_default="by its name")]
    = None,
    start_angle: StartAngles = None,
    measured: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Measured pitches, CSV with turn or position, pitch and, where known, flank, "
                             "start_angle_deg, uncertainty_um: judged against the last group.")] = None,
    target: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Movement per revolution that was wanted.", show_default="of --thread")]
    = None,
    uncertainty: Annotated[float | None, typer.Option(
        metavar="UM", parser=number, help="Standard uncertainty of one measured pitch.")] = None,
    screw_lead: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Lead of the feed's ball screw, to know its turns again.")] = None,
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
    asked = Judged(measured, target, uncertainty, screw_lead, thread, limit, engagement)
    choice = ColumnChoice(angle, position, angle_unit, position_unit, group, time, counts_per_turn)
    groups = pitch_tables(log, choice, radians(start_angle or [0.0]))
    found = find(groups, asked)
    with printing():
        if as_json:
            print_json(analysis_document(groups) | findings_document(found))
        else:
            show_groups(Console(), groups)
            show_findings(Console(), found)
