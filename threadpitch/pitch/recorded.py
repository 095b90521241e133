"""P(n) of recordings that are in memory, and of the groups of a log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from numpy.typing import ArrayLike

from threadpitch.pitch.stream import PitchStream
from threadpitch.pitch.table import PitchTable
from threadpitch.trace import ColumnChoice, Signals, Trace, TraceError, read_groups, samples


@dataclass(frozen=True, eq=False)
class GroupPitch:
    """The pitches of one group of a log."""

    label: str
    trace: Trace
    table: PitchTable

    @property
    def begins(self) -> float:
        """The first angle, rad."""
        return float(self.trace.angle[0])


def thread_pitch(angle: ArrayLike, position: ArrayLike, start_angles: ArrayLike | None = (0.0,)) -> PitchTable:
    """P(n) = xi(theta_S + 360 n) - xi(theta_S + 360 (n - 1)), signed by the direction of the cut.

    Args:
        angle: (samples,) rad, continuous, counted up in the turning direction of the cut.
        position: (samples,) m, at the same instants.
        start_angles: theta_S (start_angles,) rad, from angle zero of the array as given; None = at the first sample.

    xi at a crossing is interpolated linearly between the first sample that reaches the angle and the sample before
    it, so that a quantised angle crosses where its count changes, and a count that goes back and comes again does not
    cross twice. A crossing less than one sample's movement before the first sample is extrapolated from the first two
    different angles and flagged. The direction of the cut is that of the movement from the first to the last sample;
    a turn that moves back is negative. n = 1 begins at theta_S; but when the first sample lies more than
    ``FARTHEST_ZERO`` turns away from there, n = 1 is the turn of the first sample (``PitchTable.turns_before``).

    Raises:
        TraceError: what ``Trace`` refuses: shapes, NaN, a reversal of the spindle.
        PitchError: less than one whole turn, or start angles that are no finite numbers within 100 turns.

    Source: US 2016/0008901 A1, formula 2.
    """
    stream = PitchStream(start_angles)
    if (size := samples("angle", angle, "trace").size) < 2:
        raise TraceError(f"trace: {size} samples; a pitch needs two and a whole turn between them")
    stream.add(angle, position)
    return stream.final_table()


def pitch_table(trace: Trace, start_angles: ArrayLike | None = (0.0,)) -> PitchTable:
    """``thread_pitch`` of a trace.

    Raises:
        PitchError: less than one whole turn, or start angles that are no finite numbers within 100 turns.
    """
    stream = PitchStream(start_angles, limit=trace.reversal_limit, label=trace.whole(), margin=trace.margin)
    stream.add(trace.angle, trace.position)
    table = stream.final_table()
    return replace(table, notes=tuple(note for note in (*trace.notes, table.standstill()) if note))


TableOf = Callable[[Trace, ArrayLike | None], PitchTable]


def pitch_tables(path: str | Path, choice: ColumnChoice, start_angles: ArrayLike | None = (0.0,),
                 signals: Signals | None = None, table: TableOf = pitch_table, *,
                 told: Callable[[int], None] | None = None,
                 read: Callable[[float], None] | None = None) -> list[GroupPitch]:
    """The pitches of every group of a log; ``table`` makes them of a trace: ``pitch_table`` or ``edge_pitch_table``.

    ``told`` hears the number of samples of each piece that is read, ``read`` what share of the log is read, 0 to 1,
    where that is known.

    Raises:
        TraceError: the log cannot be read (``read_groups``).
        PitchError: a group has less than one whole turn.
    """
    return [GroupPitch(trace.name, trace, table(trace, start_angles))
            for trace in read_groups(path, choice, signals, told=told, read=read)]
