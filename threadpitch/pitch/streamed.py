"""P(n) of logs that may be larger than memory: every piece is forgotten when the next one comes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import ArrayLike

from threadpitch.pitch.edge_stream import EdgeStream
from threadpitch.pitch.stored import Stored, grid, stored
from threadpitch.pitch.stream import PitchStream
from threadpitch.pitch.table import PitchTable
from threadpitch.trace import (
    TURN,
    ColumnChoice,
    Group,
    Samples,
    Signals,
    TraceError,
    read_pieces,
    reversal_limit,
    time_fault,
)


@dataclass(frozen=True, eq=False)
class StreamedPitch:
    """The pitches of one group of a log."""

    label: str
    table: PitchTable
    stored: Stored | None = None
    begins: float = 0.0  # rad, the first angle


class GroupStream:
    """A group of a log while its pieces come: what ``Trace`` checks of a whole group, and a ``PitchStream``."""

    def __init__(self, group: Group, start_angles: ArrayLike | None, interval: float | None = None, *,
                 edges: bool = False) -> None:
        self.group = group
        self._asked, self._interval = start_angles, interval
        self._factor = 1.0
        if interval is not None:
            start_angles, self._factor = grid(interval)
        self._label = group.named
        limit = self._factor * reversal_limit(group.resolution)
        self.pitches = PitchStream(start_angles, limit=limit, label=self._label, source=group.source,
                                   margin=None if group.margin is None else self._factor * group.margin)
        self._by_edges = edges
        self._edges: EdgeStream | None = None  # from the first sample on
        self._time = -math.inf  # of the last sample
        self._began = math.nan  # time of the first sample
        self._ends = [math.nan, math.nan]  # first and last angle

    def add(self, coming: Samples) -> None:
        """The next samples.

        Raises:
            TraceError: with the line: time that runs back, NaN, a reversal of the spindle.
            PitchError: more turns than the samples can hold.
        """
        if coming.time is not None and coming.size:
            fault = time_fault(coming.time, self._time)
            if fault is not None:
                sample, text = fault
                raise TraceError(f"{self.group.place(coming.lines, sample, self.pitches.size)}: {text}")
            self._began = self._began if self.pitches.size else float(coming.time[0])
            self._time = float(coming.time[-1])
        if coming.size:
            first, last = (float(coming.angle_values[place]) * coming.angle_factor for place in (0, -1))
            self._ends = [self._ends[0] if self.pitches.size else first, last]
        if self._factor == 1.0:
            self.pitches.add(coming.angle_values, coming.position_values, coming.lines,
                             factors=(coming.angle_factor, coming.position_factor))
        else:
            self.pitches.add(coming.angle * self._factor, coming.position, coming.lines)
        if self._by_edges and coming.size:
            if self._edges is None:
                self._edges = EdgeStream(self.pitches.start_angles, self.pitches.turns_before, self.group.resolution,
                                         self._label)
            self._edges.add(coming.angle, coming.position)

    def check_unit(self) -> None:
        """Whether the angle may have its unit, by the samples so far.

        Raises:
            TraceError: more turns than samples; of an assumed unit more than can be in a sample, or in the time.
        """
        turns = max((self._ends[1] - self._ends[0]) / TURN, self.group.went_round)
        seconds = 0.0 if math.isnan(self._began) else self._time - self._began
        if doubt := self.group.chosen.angle_unit_doubt(turns, self.pitches.size, seconds):
            raise TraceError(f"{self._label}: {doubt}")

    def result(self) -> StreamedPitch:
        """The pitches of the whole group.

        Raises:
            TraceError: fewer than two samples, more turns than samples.
            PitchError: less than one whole turn.
        """
        size = self.pitches.size
        if size < 2:
            raise TraceError(f"{self._label}: {size} samples; a pitch needs two and a whole turn between them")
        self.check_unit()
        table = self.pitches.final_table()
        points = None
        if self._interval is not None:
            points = replace(stored(table, self._interval), passing=self.group.parted)
            beginning = ("the first stored positions are extrapolated",) if table.extrapolated.any() else ()
            table = points.pitch_table((0.0,) if self._asked is None else self._asked)
            table = replace(table, notes=(*table.notes, *beginning))
        notes = tuple(note for note in (*self.group.all_notes(), *table.notes, table.standstill()) if note)
        table = replace(table, notes=notes)
        return StreamedPitch(self.group.label, table if self._edges is None else self._edges.table(table), points,
                             self._ends[0])


def stream_pitches(path: str | Path, choice: ColumnChoice, start_angles: ArrayLike | None = (0.0,),
                   signals: Signals | None = None, *, interval: float | None = None, edges: bool = False,
                   told: Callable[[int], None] | None = None, read: Callable[[float], None] | None = None,
                   taken: Callable[[str, Samples], None] | None = None) -> list[StreamedPitch]:
    """``pitch_tables`` in bounded memory, with the same bits; ``told`` hears the number of samples of each piece,
    ``read`` what share of the log is read, 0 to 1, where that is known, ``taken`` gets the samples themselves with the
    label of its group.

    With an ``interval`` (rad) P(n) comes out of positions that are stored at its multiples (``Stored``); with ``edges``
    crossings are those of ``edge_pitch_table``.

    Raises:
        TraceError: the log cannot be read (``read_groups``), or something is asked for that needs the whole.
        PitchError: a group has less than one whole turn.
    """
    if signals is not None and signals.needs_the_whole:
        raise TraceError("a latency that is to be estimated needs the whole log in memory; use pitch_tables")
    found: list[StreamedPitch] = []
    now: GroupStream | None = None
    with read_pieces(path, choice, signals, read=read) as pieces:
        for group, coming in pieces:
            if now is None or now.group is not group:
                if now is not None:
                    found.append(now.result())
                now = GroupStream(group, start_angles, interval, edges=edges)
            now.add(coming)
            if taken is not None:
                taken(group.label, coming)
            if told is not None:
                told(coming.size)
    if now is not None:
        found.append(now.result())
    return found
