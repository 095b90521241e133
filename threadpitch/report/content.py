"""What a report says, before anything is drawn: threads with their pitches, judgements and recordings.

Page, paper and server draw the same ``Report``; where a thread comes from (a run folder, a log, a store) is behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.judgement import JudgementError, MeasuredThread, Verdict, judge
from threadpitch.pitch import BoolArray, PitchTable, leads_of_turns
from threadpitch.tolerance import PitchConformity
from threadpitch.trace import TURN, FloatArray


class ReportError(ValueError):
    """A report cannot be made: what is wrong with its input, where, and how to mend it."""


@dataclass(frozen=True, eq=False)
class Samples:
    """The recording of a thread: turn 0 is where n = 1 of the first start angle begins, so that it ends at turn 1."""

    turn: FloatArray  # (samples,) revolutions, rising
    position: FloatArray  # (samples,) m from turn 0, positive in the direction of the cut
    speed: FloatArray | None = None  # (samples,) rad/s
    following_error: FloatArray | None = None  # (samples,) m


@dataclass(frozen=True, eq=False)
class Measured:
    """Pitches of the real thread, laid over the nominal ones."""

    name: str
    turn: FloatArray  # (turns,) numbered as the nominal table does
    pitch: FloatArray  # (turns,) m
    uncertainty: float | None = None  # m, largest standard uncertainty of one pitch, where it is known
    behind: float = 0.0  # turns that its start angle lies behind the first of the nominal pitches


@dataclass(frozen=True, eq=False)
class Thread:
    """One thread of a report: a pass of a run, or a group of a log."""

    name: str
    nominal: PitchTable
    target: float  # m, movement per revolution that was wanted; where it changes that where n = 1 begins
    chosen: BoolArray  # (start_angles, revolutions) turns of the thread proper: in the metal, the feed at speed
    lines: tuple[str, ...] = ()  # what is told of it: kind, depth, where the target comes from
    limit: float | None = None  # m, that |P(n) - target| may reach
    measured: tuple[Measured, ...] = ()
    verdict: Verdict | None = None
    tolerances: tuple[tuple[str, PitchConformity], ...] = ()  # (of what, how it keeps to its tolerance)
    samples: Samples | None = None  # of the detectors: what the control knows
    groove: Samples | None = None  # of a simulated groove: what a measuring machine would find
    screw_lead: float | None = None  # m, of the feed's ball screw
    others: PassOverview | None = None  # the passes beside this one
    notes: tuple[str, ...] = ()  # what is missing, and why
    provenance: tuple[tuple[str, str], ...] = ()  # (what, how)
    lead_change: float = 0.0  # m per turn, in every turn

    @property
    def deviation(self) -> FloatArray:
        """P(n) - target, (start_angles, revolutions) m."""
        return np.asarray(self.nominal.pitch - self.targets)

    @property
    def targets(self) -> FloatArray:
        """The movement that was wanted of every turn, (start_angles, revolutions) m."""
        return leads_of_turns(self.nominal, self.target, self.lead_change)

    def measured_deviation(self, measured: Measured) -> FloatArray:
        """Measured pitches less what was wanted of their turns, (turns,) m."""
        return np.asarray(measured.pitch - self.target - self.lead_change * (measured.turn - 0.5 + measured.behind))

    def ideal(self, turn: FloatArray) -> FloatArray:
        """xi of the thread that was wanted, (samples,) m, after so many turns from the beginning of n = 1 on."""
        return np.asarray(self.target * turn + 0.5 * self.lead_change * turn**2)

    @property
    def middle_target(self) -> float:
        """The movement per revolution that was wanted in the middle of the thread proper, m."""
        first, last = self.first_and_last
        return self.target + 0.5 * self.lead_change * (first - 1 + last)

    @property
    def truest(self) -> tuple[Samples | None, str]:
        """The recording that is nearest to the real thread, and what it is of."""
        return (self.samples, "by the detectors") if self.groove is None else (self.groove, "of the groove")

    @property
    def first_and_last(self) -> tuple[int, int]:
        """The turns of the thread proper, of the first start angle that has some."""
        turns = np.flatnonzero(self.chosen.any(axis=0)) + 1
        return (int(turns[0]), int(turns[-1])) if turns.size else (1, self.nominal.pitch.shape[1])


@dataclass(frozen=True)
class PassOverview:
    """All passes of a run or groups of a log, one line each: name, then least, greatest and mean P(n), m."""

    rows: tuple[tuple[str, float, float, float], ...]


@dataclass(frozen=True, eq=False)
class Report:
    """Threads that are looked at together; of several, the curves lie over one another."""

    title: str
    threads: tuple[Thread, ...]
    provenance: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        if not self.threads:
            raise ReportError("there is no thread to report on; give a run folder or a log")


def laid_over(table: PitchTable, measured: Sequence[MeasuredThread]) -> tuple[Measured, ...]:
    """Measured threads with turn numbers: their own, or counted from 1."""
    found = []
    for one in measured:
        turn = np.arange(1.0, one.pitch.size + 1.0) if one.turn is None else one.turn
        angle = "" if one.start_angle is None else f"{360.0 * one.start_angle / TURN:.6g} deg"
        name = ", ".join(word for word in ("measured", one.flank, angle) if word)
        inside = (turn >= 1.0) & (turn <= table.pitch.shape[1])
        uncertainty = None if one.uncertainty is None else float(one.uncertainty.max())
        behind = 0.0 if one.start_angle is None else (one.start_angle - float(table.start_angles[0])) / TURN
        found.append(Measured(name, turn[inside], one.pitch[inside], uncertainty, behind))
    return tuple(found)


def judged(thread: Thread, nominal: FloatArray | PitchTable, measured: FloatArray | Sequence[MeasuredThread],
           uncertainty: float | None) -> Thread:
    """The thread with its verdict, or with a note that tells why there is none."""
    try:
        target = thread.targets if thread.lead_change else thread.target
        return replace(thread, verdict=judge(nominal, measured, target=target, uncertainty=uncertainty,
                                             screw_lead=thread.screw_lead))
    except JudgementError as error:
        return replace(thread, notes=(*thread.notes, f"No verdict: {error}"))
