"""``threadpitch watch``: each P(n) as soon as its revolution is complete."""

from __future__ import annotations

import contextlib
import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer

from threadpitch.cli.judging import Findings
from threadpitch.cli.kept import Keeper, keeping_run, stored_line
from threadpitch.cli.log_options import LogOptions
from threadpitch.cli.option_records import with_option_records
from threadpitch.cli.options import AsJson, StartAngles, number, radians, refuse
from threadpitch.cli.printing import printing, remark
from threadpitch.cli.store_options import NOT_KEPT, KeepOptions, ThreadName, refuse_labels_of_nothing
from threadpitch.pitch import GroupStream, StreamedPitch, thread_pitch
from threadpitch.runs.events import Running, Turn
from threadpitch.store.records import LOG
from threadpitch.tables import printable
from threadpitch.trace import TURN, Group, Samples, TraceError, watch_pieces
from threadpitch.units import from_si


@with_option_records
def watch(
    context: typer.Context,
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Text log that still grows; - for standard input.")],
    of_log: LogOptions,
    target: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Movement per revolution of the passes that --synchronous or --index-enable "
                                          "find.", show_default="that of most turns so far")] = None,
    start_angle: StartAngles = None,
    idle: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="End when the file has not grown for so long.", show_default="never")] = None,
    keep: KeepOptions = NOT_KEPT,
    thread: ThreadName = "",
    as_json: AsJson = False,
) -> None:
    """Print each movement per revolution, with running minimum, maximum and mean, while the machine runs."""
    if not of_log.synchronous and of_log.index_enable is None:
        refuse(context, ("target",), "is of passes that are found; give --synchronous or --index-enable too, or leave "
                                     "it out")
    refuse_labels_of_nothing(context, "thread")
    choice, signals = of_log.choice(), of_log.signals(target)
    starts = radians(start_angle or [0.0])
    if idle is not None and idle < 0.0:
        raise TraceError(f"--idle is {idle:g} s; give 0 or more")
    thread_pitch([0.0, TURN, 2.0 * TURN], [0.0, 1.0, 2.0])  # what is compiled is loaded before the first sample comes
    with keeping_run(keep.asked(thread=thread), "log", str(log)) as keeper:
        watched = _Watched(starts, keeper)
        with contextlib.suppress(KeyboardInterrupt), printing():  # that is how one stops watching
            if not as_json:
                print(_HEADING, flush=True)
            for owner, samples in watch_pieces(log, choice, signals, idle=math.inf if idle is None else idle):
                for turn in watched.add(owner, samples):
                    print(turn.as_json() if as_json else turn.as_text(), flush=True)
        if keeper is not None:
            stored = keeper.finish_log(watched.results(), Findings(), {"choice": asdict(choice),
                                                                       "signals": asdict(signals)})
            remark(f"note: {stored_line(stored)}")


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


class _Watched:
    """The groups of a log that grows, and what is complete of them."""

    def __init__(self, starts: list[float], keeper: Keeper | None) -> None:
        self._starts, self._keeper = starts, keeper
        self._groups: list[GroupStream] = []
        self._running: list[Running] = []
        self._told: list[int] = []  # turns of each start angle of the last group

    def add(self, group: Group, samples: Samples) -> list[_Turn]:
        """The revolutions that are complete with the next samples; they are kept before they are told."""
        if not self._groups or self._groups[-1].group is not group:
            if self._keeper is None:
                self._groups.clear()  # of a former group nothing is needed any more
            if not self._told and (note := group.chosen.assumed_unit_note()):
                remark(f"note: {note}")
            self._groups.append(GroupStream(group, self._starts))
            self._running, self._told = [Running() for _ in self._starts], [0 for _ in self._starts]
        now = self._groups[-1]
        now.add(samples)
        now.check_unit()
        turns = [Turn(LOG, group.label, turn, self._starts[k], pitch)
                 for k, completed in enumerate(now.pitches.completed.tolist())
                 for turn in range(self._told[k] + 1, completed + 1)
                 if not math.isnan(pitch := now.pitches.pitch_of(k, turn))]
        self._told = now.pitches.completed.tolist()
        if self._keeper is not None:
            self._keeper.sample(group.label, samples)
            self._keeper.turns(turns)
        return [self._line(turn) for turn in turns]

    def results(self) -> list[StreamedPitch]:
        """The pitches of all groups that have a whole turn."""
        return [one.result() for one in self._groups if one.pitches.size > 1 and one.pitches.completed.any()]

    def _line(self, turn: Turn) -> _Turn:
        running = self._running[self._starts.index(turn.start_angle)]
        figures = (from_si(value, "mm") for value in (turn.pitch, *running.add(turn.pitch)))
        return _Turn(turn.group, turn.number, round(math.degrees(turn.start_angle), 9), *figures)
