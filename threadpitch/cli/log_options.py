"""Options that say what the columns of a log are, and what its signals are, shared by all commands that read logs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from threadpitch.cli.options import number
from threadpitch.trace import ColumnChoice, Signals, TraceError

_MM = 1e-3  # m


@dataclass(frozen=True)
class LogOptions:
    """The options in their units, mm and degrees."""

    angle: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column of the spindle's angle: its name, or its number from 1.",
        show_default="by its name")] = None
    position: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column of the feed's position.", show_default="by its name")] = None
    angle_unit: Annotated[str | None, typer.Option(
        metavar="rev|deg|rad|count", help="Unit of the angle.",
        show_default="of the header, else what the samples tell, else rev")] = None
    position_unit: Annotated[str | None, typer.Option(
        metavar="mm|m|um|inch", help="Unit of the position; with --screw-lead rev, deg, rad or count.",
        show_default="of the header, else mm")] = None
    counts_per_turn: Annotated[float | None, typer.Option(
        metavar="N", parser=number,
        help="Counts per turn, lines of the encoder times 4: for --angle-unit count; of an angle in another unit "
             "how finely it is resolved.")] = None
    angle_b: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="The angle is level A of an encoder, this column is its level B: counted.")] = None
    index: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="One-turn pulse of the encoder with levels A and B.")] = None
    group: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column that parts the passes; rows with 0, false or nothing in it are left out.",
        show_default="by its name, where the angle is too")] = None
    time: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column of the time.", show_default="by its name")] = None
    angle_wrap: Annotated[float | None, typer.Option(
        metavar="PERIOD", parser=number, show_default="found",
        help="Where a wrapped angle begins again, in its unit: 360, 65536, ...; 0 = never.")] = None
    position_wrap: Annotated[float, typer.Option(
        metavar="PERIOD", parser=number,
        help="Where a wrapped position begins again, in its unit; 0 = never.")] = 0.0
    screw_lead: Annotated[float | None, typer.Option(
        metavar="MM", parser=number,
        help="The position is the angle of a motor that drives a screw of this lead.")] = None
    gear_ratio: Annotated[float, typer.Option(
        metavar="R", parser=number, help="Turns of the motor per turn of the screw.")] = 1.0
    position_counts_per_turn: Annotated[float | None, typer.Option(
        metavar="N", parser=number, help="Counts per turn of the motor, for --position-unit count.")] = None

    index_enable: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="A pass begins where this column falls, and ends with the synchronous motion.")] = None
    synchronous: Annotated[bool, typer.Option(
        "--synchronous", help="Passes are where the feed moves in step with the spindle (by --target, if given).")] \
        = False

    def choice(self) -> ColumnChoice:
        """Which columns are which."""
        return ColumnChoice(self.angle, self.position, self.angle_unit, self.position_unit, self.group, self.time,
                            self.counts_per_turn, self.angle_b, self.index, self.index_enable)

    def signals(self, target_mm: float | None, **more: Any) -> Signals:
        """What the signals are; ``target_mm``: movement per turn of passes that are to be found; ``more`` in SI."""
        if target_mm is not None and not 0.0 < target_mm < math.inf:
            raise TraceError(f"--target is {target_mm:g} mm; give a positive movement per revolution")
        screw = None if self.screw_lead is None else _MM * self.screw_lead
        if screw is None and (self.gear_ratio != 1.0 or self.position_counts_per_turn is not None):
            raise TraceError("--gear-ratio and --position-counts-per-turn are of a motor's angle; give --screw-lead")
        parted = self.synchronous or self.index_enable is not None
        lead = _MM * target_mm if parted and target_mm is not None else None
        return Signals(self.angle_wrap, self.position_wrap, screw, self.gear_ratio, self.position_counts_per_turn,
                       synchronous=self.synchronous, lead=lead, **more)


def latency(text: str) -> float:
    """Seconds of a latency in ms; NaN for ``estimate``."""
    return math.nan if text == "estimate" else 1e-3 * number(text)


Latency = Annotated[float, typer.Option(
    metavar="MS|estimate", parser=latency, help="The position was recorded so many ms later than the angle.")]
Outlier = Annotated[float | None, typer.Option(
    metavar="MM", parser=number, help="Put single positions that stick out by more than this between their "
                                      "neighbours.")]
