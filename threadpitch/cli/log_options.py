"""Options that say what the columns of a log are; ``analyze`` and ``watch`` share them."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from threadpitch.cli.options import number

Angle = Annotated[str | None, typer.Option(
    "--angle", metavar="COLUMN", help="Column of the spindle's angle: its name, or its number from 1.",
    show_default="by its name")]
Position = Annotated[str | None, typer.Option(
    "--position", metavar="COLUMN", help="Column of the feed's position.", show_default="by its name")]
AngleUnit = Annotated[str | None, typer.Option(
    "--angle-unit", metavar="rev|deg|rad|count", help="Unit of the angle.", show_default="of the header, else rev")]
PositionUnit = Annotated[str | None, typer.Option(
    "--position-unit", metavar="mm|m|um|inch", help="Unit of the position; with --screw-lead rev, deg, rad or count.",
    show_default="of the header, else mm")]
CountsPerTurn = Annotated[float | None, typer.Option(
    "--counts-per-turn", metavar="N", parser=number,
    help="Counts per turn, for --angle-unit count: lines of the encoder times 4.")]
GroupColumn = Annotated[str | None, typer.Option(
    "--group", metavar="COLUMN", help="Column that parts the passes; rows with 0, false or nothing in it are left out.",
    show_default="by its name, where the angle is too")]
TimeColumn = Annotated[str | None, typer.Option(
    "--time", metavar="COLUMN", help="Column of the time.", show_default="by its name")]
AngleWrap = Annotated[float | None, typer.Option(
    "--angle-wrap", metavar="PERIOD", parser=number, show_default="found",
    help="Where a wrapped angle begins again, in its unit: 360, 65536, ...; 0 = never.")]
PositionWrap = Annotated[float, typer.Option(
    "--position-wrap", metavar="PERIOD", parser=number,
    help="Where a wrapped position begins again, in its unit; 0 = never.")]
ScrewLead = Annotated[float | None, typer.Option(
    "--screw-lead", metavar="MM", parser=number,
    help="The position is the angle of a motor that drives a screw of this lead.")]
GearRatio = Annotated[float, typer.Option(
    "--gear-ratio", metavar="R", parser=number, help="Turns of the motor per turn of the screw.")]
PositionCounts = Annotated[float | None, typer.Option(
    "--position-counts-per-turn", metavar="N", parser=number,
    help="Counts per turn of the motor, for --position-unit count.")]


def latency(text: str) -> float:
    """Seconds of a latency in ms; NaN for ``estimate``."""
    return math.nan if text == "estimate" else 1e-3 * number(text)


Latency = Annotated[float, typer.Option(
    "--latency", metavar="MS|estimate", parser=latency,
    help="The position was recorded so many ms later than the angle.")]
