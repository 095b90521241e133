"""A group of a machine's log -> a thread of a report."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from threadpitch.judgement import MeasuredThread
from threadpitch.pitch import (
    BoolArray,
    GroupPitch,
    PitchTable,
    first_lead,
    leads_of_turns,
    statistics,
    thread_proper,
)
from threadpitch.report.content import PassOverview, ReportError, Samples, Thread, judged, laid_over
from threadpitch.trace import TURN, FloatArray, Trace
from threadpitch.units import from_si

_SPEED_POINTS = 72  # per turn: the speed is the mean over every 5 degrees


@dataclass(frozen=True, eq=False)
class LogQuestion:
    """What is known of the thread beside the log; lengths in m."""

    target: float | None = None
    measured: tuple[MeasuredThread, ...] = ()
    uncertainty: float | None = None
    screw_lead: float | None = None
    lead_change: float = 0.0  # m per turn, in every turn; from the target at the first sample on


def chosen_groups(groups: Sequence[GroupPitch], path: Path, chosen: str | None) -> list[GroupPitch]:
    """The groups that are reported on: the one called ``chosen``, ``all`` of them, or the last.

    Raises:
        ReportError: there is none of this name.
    """
    if chosen is None:
        return [groups[-1]]
    found = [group for group in groups if chosen in ("all", group.label)]
    if not found:
        raise ReportError(f"{path}: there is no group {chosen!r}; the groups are "
                          f"{', '.join(group.label for group in groups)}")
    return found


def log_thread(path: Path, group: GroupPitch, groups: Sequence[GroupPitch], question: LogQuestion) -> Thread:
    """A group as a thread of a report; without a target the median of its turns is taken for one."""
    chosen, target, said = _wanted(group, question)
    label = f", group {group.label}" if group.label else ""
    thread = Thread(
        f"{path.name}{label}", group.table, target, chosen, (f"Nominal pitches from the log; {said}",),
        lead_change=question.lead_change,
        samples=trace_samples(group.trace, group.table), screw_lead=question.screw_lead,
        others=PassOverview(tuple(_row(one) for one in groups)),
        notes=(*group.table.notes, *_left_out(chosen, group.table.pitch)),
        provenance=(("log", str(path)), ("SHA-256 of the log", _digest(path)), ("group", group.label),
                    ("samples", f"{group.trace.angle.size}")))
    if not question.measured:
        return thread
    return judged(replace(thread, measured=laid_over(group.table, question.measured)), group.table, question.measured,
                  question.uncertainty)


def _wanted(group: GroupPitch, question: LogQuestion) -> tuple[BoolArray, float, str]:
    """(turns of the thread proper, their target [m] where n = 1 begins, the same in words)."""
    table, lead, change = group.table, question.target, question.lead_change
    if lead is not None and change:
        target = first_lead(table, lead, change, group.begins)
        return (thread_proper(table.pitch - leads_of_turns(table, target, change)), target,
                f"target {from_si(lead, 'mm'):.6g} mm at the first sample, {from_si(change, 'mm'):+.6g} mm a turn")
    chosen = thread_proper(table.pitch)
    if lead is not None:
        return chosen, lead, f"target {from_si(lead, 'mm'):.6g} mm"
    median = float(np.median(table.pitch[chosen]))
    return chosen, median, (f"target {from_si(median, 'mm'):.6g} mm (the median of its turns, because no target was "
                            "given)")


def trace_samples(trace: Trace, table: PitchTable) -> Samples:
    """A recording as a report shows it: from where n = 1 of the first start angle begins; the speed where it can."""
    begin = float(table.start_angles[0]) / TURN + table.turns_before
    turn = np.maximum.accumulate(trace.angle) / TURN - begin
    position = trace.position - np.interp(0.0, turn, trace.position)
    speed = None if trace.time is None else _speed(turn, trace.time)
    return Samples(turn, -position if trace.position[-1] < trace.position[0] else position, speed)


def _speed(turn: FloatArray, time: FloatArray) -> FloatArray | None:
    """(samples,) rad/s by the time that every 5 degrees took; a count of the encoder is no change of the speed."""
    grid = np.arange(turn[0], turn[-1], 1.0 / _SPEED_POINTS)
    passed = np.diff(np.interp(grid, turn, time)) if grid.size > 2 else np.zeros(0)
    if grid.size <= 2 or not (passed > 0.0).all():
        return None
    return np.interp(turn, 0.5 * (grid[1:] + grid[:-1]), TURN / _SPEED_POINTS / passed)


def _row(group: GroupPitch) -> tuple[str, float, float, float]:
    found = statistics(np.where(thread_proper(group.table.pitch), group.table.pitch, np.nan).reshape(1, -1))
    return f"group {group.label}", float(found.minimum[0]), float(found.maximum[0]), float(found.mean[0])


def _left_out(chosen: BoolArray, pitch: FloatArray) -> tuple[str, ...]:
    """Which turns the curves leave out, and why."""
    out = np.flatnonzero((~np.isnan(pitch) & ~chosen).any(axis=0)) + 1
    if not out.size:
        return ()
    return (f"Turns {', '.join(str(turn) for turn in out.tolist()[:10])}{', ...' if out.size > 10 else ''} at the ends "
            "are far outside of what the others do (feed starts or ends); the tables hold them, curves are scaled "
            "without them",)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
