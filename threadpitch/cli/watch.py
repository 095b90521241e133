"""``threadpitch watch``: each P(n) as soon as its revolution is complete."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from threadpitch.cli.log_options import LogOptions, with_log_options
from threadpitch.cli.options import AsJson, StartAngles, number, radians
from threadpitch.cli.printing import printing
from threadpitch.pitch import GroupStream, thread_pitch
from threadpitch.tables import printable
from threadpitch.trace import TURN, ColumnChoice, Signals, watch_pieces


@with_log_options
def watch(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Text log that still grows; - for standard input.")],
    of_log: LogOptions,
    start_angle: StartAngles = None,
    idle: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="End when the file has not grown for so long.", show_default="never")] = None,
    as_json: AsJson = False,
) -> None:
    """Print each movement per revolution, with running minimum, maximum and mean, while the machine runs."""
    choice, signals = of_log.choice(), of_log.signals()
    starts = radians(start_angle or [0.0])
    thread_pitch([0.0, TURN, 2.0 * TURN], [0.0, 1.0, 2.0])  # what is compiled is loaded before the first sample comes
    try:
        with printing():
            if not as_json:
                print(_HEADING, flush=True)
            for turn in _turns(log, choice, signals, starts, math.inf if idle is None else idle):
                print(turn.as_json() if as_json else turn.as_text(), flush=True)
    except KeyboardInterrupt:
        return  # that is how one stops watching


_HEADING = "group        n  theta_S [deg]    P(n) [mm]     min [mm]     max [mm]    mean [mm]"


@dataclass(frozen=True)
class _Turn:
    """A revolution that is complete, and what is known of its group up to it; mm and degrees."""

    group: str
    turn: int
    start_angle_deg: float
    pitch_mm: float
    min_mm: float
    max_mm: float
    mean_mm: float

    def as_text(self) -> str:
        figures = "  ".join(f"{value:11.4f}" for value in (self.pitch_mm, self.min_mm, self.max_mm, self.mean_mm))
        return f"{printable(self.group):8.8s} {self.turn:5d}  {self.start_angle_deg:13.6g}  {figures}"

    def as_json(self) -> str:
        return json.dumps(vars(self), allow_nan=False)


class _Running:
    """Least, greatest and mean of what one start angle has had."""

    def __init__(self) -> None:
        self.least, self.greatest, self.total, self.count, self.turn = math.inf, -math.inf, 0.0, 0, 0

    def add(self, value: float) -> tuple[float, float, float]:
        self.least, self.greatest = min(self.least, value), max(self.greatest, value)
        self.total, self.count = self.total + value, self.count + 1
        return self.least, self.greatest, self.total / self.count


def _turns(log: Path, choice: ColumnChoice, signals: Signals, starts: list[float], idle: float) -> Iterator[_Turn]:
    now: GroupStream | None = None
    running = [_Running() for _ in starts]
    for group, piece in watch_pieces(log, choice, signals, idle=idle):
        if now is None or now.group is not group:
            now = GroupStream(group, starts)
            running = [_Running() for _ in starts]
        now.add(piece)
        for k, completed in enumerate(now.pitches.completed.tolist()):
            for turn in range(running[k].turn + 1, completed + 1):
                pitch = 1e3 * now.pitches.pitch_of(k, turn)
                if not math.isnan(pitch):
                    yield _Turn(group.label, turn, round(math.degrees(starts[k]), 9), pitch, *running[k].add(pitch))
            running[k].turn = completed
