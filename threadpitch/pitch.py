"""Movement of the feed axis per revolution of the spindle: ``Trace`` -> ``PitchTable``.

    P(n) = xi(theta_S + 360 n) - xi(theta_S + 360 (n - 1))

xi(theta) is the feed position at the spindle angle theta, theta_S a start angle. Source: US 2016/0008901 A1, formulae
1 and 2. P(n) is the nominal thread pitch for control of a single-start thread; of a thread with several starts it is
the lead, and the pitch is lead / starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.compiled import compiled
from threadpitch.trace import TURN, ColumnChoice, FloatArray, IntArray, Trace, read_groups

BoolArray = NDArray[np.bool_]

FARTHEST_ZERO = 100  # turns; an angle zero farther away is that of a counter, no longer that of this thread
MOST_TURNS_PER_SAMPLE = 1000.0
ROUNDING = 8.0 * float(np.finfo(np.float64).eps)  # of an angle that was converted to rad


class PitchError(ValueError):
    """No pitch can be calculated for these start angles from this trace."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """Least, greatest and mean movement per revolution over the turns that are there; NaN where there is none."""

    minimum: FloatArray  # (start_angles,) m
    maximum: FloatArray  # (start_angles,) m
    mean: FloatArray  # (start_angles,) m


@dataclass(frozen=True, eq=False)
class PitchTable:
    """Movement per revolution P(n), for every start angle: ``pitch[k, n - 1]``.

    P(n) lies between theta_S + 360 (n - 1 + turns_before) and theta_S + 360 (n + turns_before) of the angle as given.
    """

    start_angles: FloatArray  # (start_angles,) rad
    pitch: FloatArray  # (start_angles, revolutions) m, positive in the direction of the cut; NaN outside the trace
    crossings: FloatArray  # (start_angles, revolutions + 1) m, xi as given; NaN outside the trace
    extrapolated: BoolArray  # (start_angles,) the first crossing lies before the first sample
    turns_before: int = 0  # whole turns between angle zero and the beginning of n = 1
    notes: tuple[str, ...] = ()  # what was done to the recording

    @classmethod
    def of_pitches(cls, pitch: ArrayLike, start_angles: ArrayLike) -> PitchTable:
        """A table of pitches (start_angles, revolutions) m that were calculated elsewhere; its crossings are NaN."""
        movement = np.atleast_2d(np.asarray(pitch, dtype=np.float64))
        starts = np.atleast_1d(np.asarray(start_angles, dtype=np.float64))
        if movement.shape[0] != starts.size:
            raise PitchError(f"{movement.shape[0]} rows of pitches, {starts.size} start angles; give one row for each")
        crossings = np.full((movement.shape[0], movement.shape[1] + 1), np.nan)
        return cls(starts, movement, crossings, np.zeros(starts.size, dtype=np.bool_))

    @property
    def minimum(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.minimum

    @property
    def maximum(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.maximum

    @property
    def mean(self) -> FloatArray:
        """(start_angles,) m over all turns."""
        return self.statistics.mean

    @cached_property
    def statistics(self) -> Statistics:
        """Over all turns; those of a part of the thread are ``statistics(table.pitch[:, first:last])``."""
        return statistics(self.pitch)


@dataclass(frozen=True, eq=False)
class GroupPitch:
    """The pitches of one group of a log."""

    label: str
    trace: Trace
    table: PitchTable


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
    return pitch_table(Trace(np.asarray(angle), np.asarray(position)), start_angles)


def pitch_table(trace: Trace, start_angles: ArrayLike | None = (0.0,)) -> PitchTable:
    """``thread_pitch`` of a trace.

    Raises:
        PitchError: less than one whole turn, or start angles that are no finite numbers within 100 turns.
    """
    starts = _start_angles(trace, start_angles)
    rising = trace.angle if trace.rising else np.maximum.accumulate(trace.angle)
    before = _turns_before(float(trace.angle[0]), starts)
    revolutions = _revolutions(trace, float(rising[-1]), starts, before)
    levels = starts[:, np.newaxis] + TURN * (before + np.arange(revolutions + 1))  # (start_angles, revolutions + 1) rad
    crossings, extrapolated = _crossings(trace, rising, levels)
    crossings = crossings[:, :_past_the_last(crossings)]
    pitch = _direction(trace, crossings) * np.diff(crossings, axis=1) + 0.0  # no negative zero
    if np.isnan(pitch).all():
        raise PitchError(f"{trace.whole()}: no start angle has a whole turn between {trace.angle[0] / TURN:.4g} and "
                         f"{rising[-1] / TURN:.4g} turns; choose a smaller start angle")
    return PitchTable(starts, pitch, crossings, extrapolated, before, trace.notes)


def pitch_tables(path: str | Path, choice: ColumnChoice, start_angles: ArrayLike | None = (0.0,)) -> list[GroupPitch]:
    """The pitches of every group of a log.

    Raises:
        TraceError: the log cannot be read (``read_groups``).
        PitchError: a group has less than one whole turn.
    """
    return [GroupPitch(trace.name, trace, pitch_table(trace, start_angles)) for trace in read_groups(path, choice)]


def statistics(pitch: FloatArray) -> Statistics:
    """Min, max and mean of P(n) over n, for pitches (start_angles, revolutions) m; NaN does not count."""
    known = ~np.isnan(pitch)
    count = known.sum(axis=1)
    none = np.where(count > 0, 0.0, np.nan)  # (start_angles,) NaN where no turn is there
    return Statistics(
        minimum=np.min(pitch, axis=1, where=known, initial=np.inf) + none,
        maximum=np.max(pitch, axis=1, where=known, initial=-np.inf) + none,
        mean=np.sum(pitch, axis=1, where=known) / np.maximum(count, 1) + none,
    )


def _start_angles(trace: Trace, start_angles: ArrayLike | None) -> FloatArray:
    if start_angles is None:
        return trace.angle[:1].copy()
    try:
        starts = np.atleast_1d(np.asarray(start_angles, dtype=np.float64))
    except (TypeError, ValueError):
        raise PitchError(f"start angles are {start_angles!r}; give numbers, rad") from None
    if starts.ndim != 1 or starts.size == 0:
        raise PitchError(f"start angles have the shape {starts.shape}; give at least one, (start_angles,)")
    if not np.isfinite(starts).all():
        raise PitchError(f"start angle {starts[~np.isfinite(starts)][0]} is not finite; give an angle in rad")
    if starts.max() - starts.min() > FARTHEST_ZERO * TURN:
        raise PitchError(f"start angles lie more than {FARTHEST_ZERO} turns apart; choose them within a turn")
    return starts


def _turns_before(first: float, starts: FloatArray) -> int:
    distance = (first - float(starts.min())) / TURN
    return math.floor(distance * (1.0 + ROUNDING)) if abs(distance) > FARTHEST_ZERO else 0


def _revolutions(trace: Trace, last: float, starts: FloatArray, before: int) -> int:
    """At least as many as any start angle has."""
    turned = (last - float(trace.angle[0])) / TURN
    if turned < 1.0 - ROUNDING:
        raise PitchError(f"{trace.whole()}: the spindle turns {turned:.4g} of a turn; a pitch needs a whole one "
                         "(is the unit of the angle right?)")
    revolutions = math.floor((last - float(starts.min())) / TURN) - before + 1
    if revolutions > MOST_TURNS_PER_SAMPLE * trace.angle.size + FARTHEST_ZERO:
        raise PitchError(f"{trace.whole()}: {turned:.3g} turns in {trace.angle.size} samples; "
                         "is the unit of the angle right?")
    return max(revolutions, 1)


def _crossings(trace: Trace, rising: FloatArray, levels: FloatArray) -> tuple[FloatArray, BoolArray]:
    """xi(level) (start_angles, revolutions + 1) m and which rows begin extrapolated (start_angles,).

    ``rising`` is the running peak of the angle. A level is reached at the first sample j with peak >= level; there the
    angle itself is the peak, and angle[j - 1] < level <= angle[j].
    """
    reached = _first_reaching(rising, levels - _slack(levels))
    crossings = _interpolated(trace.angle, trace.position, levels, reached)
    early = int(np.count_nonzero((reached == 0).any(axis=0)))  # columns with levels that the first sample has reached
    before_first, extrapolated = _before_the_first(trace, rising, levels[:, :early])
    crossings[:, :early] = np.where(reached[:, :early] == 0, before_first, crossings[:, :early])
    return crossings, extrapolated


def _slack(levels: FloatArray) -> FloatArray:
    """So little before its level an angle counts as on it: a count converted to rad is not late by rounding."""
    return ROUNDING * np.maximum(np.abs(levels), TURN)


def _before_the_first(trace: Trace, rising: FloatArray, levels: FloatArray) -> tuple[FloatArray, BoolArray]:
    """xi(level) where the first sample has reached it, and which rows are extrapolated; ``_crossings``.

    It is the first sample itself, or extrapolated from the first two different angles, or NaN when the first sample
    is past the level by as much as the angle between these two.
    """
    angle, position, slack = trace.angle, trace.position, _slack(levels)
    second = int(np.searchsorted(rising, rising[0], side="right"))
    step = angle[second] - angle[0]
    passed = angle[0] - levels
    just_passed = (passed > slack) & (passed < step - slack)
    extended = position[0] - passed / step * (position[second] - position[0])
    return np.select([passed <= slack, just_passed], [position[0], extended], np.nan), just_passed.any(axis=1)


@compiled(nogil=True)
def _first_reaching(rising: FloatArray, levels: FloatArray) -> IntArray:
    """First sample j with rising[j] >= level (start_angles, revolutions + 1); the size of ``rising`` if there is none.

    Levels rise along a row. The next one is sought from where the last turn's number of samples leads, in steps that
    double, then by bisection: near memory that was just read, which a bisection of the whole is not.
    """
    size = rising.size
    reached = np.empty(levels.shape, np.int64)
    for k in range(levels.shape[0]):
        low, turn = 0, 1  # no sample before low reaches the level; samples of the last turn
        for n in range(levels.shape[1]):
            level = levels[k, n]
            begin, step = low, 1
            high = min(low + turn, size)
            while high < size and rising[high] < level:
                low, high, step = high + 1, min(high + step, size), 2 * step
            step = 1
            while high - step > low and rising[high - step] >= level:
                high, step = high - step, 2 * step
            low = max(low, high - step)
            while low < high:  # rising[low - 1] < level, and level <= rising[high] where high is a sample
                middle = (low + high) // 2
                if rising[middle] < level:
                    low = middle + 1
                else:
                    high = middle
            reached[k, n] = low
            turn = max(low - begin, 1)
    return reached


@compiled(nogil=True)
def _interpolated(angle: FloatArray, position: FloatArray, levels: FloatArray, reached: IntArray) -> FloatArray:
    """xi(level) = xi_j - (theta_j - level) / (theta_j - theta_i) (xi_j - xi_i),  i = j - 1; NaN where j has no i."""
    crossings = np.full(levels.shape, np.nan)
    for k in range(levels.shape[0]):
        for n in range(levels.shape[1]):
            j = reached[k, n]
            if 0 < j < angle.size:
                late = angle[j] - levels[k, n]
                if late <= ROUNDING * max(abs(levels[k, n]), TURN):  # sample j lies on the level and is taken as it is
                    crossings[k, n] = position[j]
                else:
                    share = late / (angle[j] - angle[j - 1])
                    crossings[k, n] = position[j] - share * (position[j] - position[j - 1])
    return crossings


def _past_the_last(crossings: FloatArray) -> int:
    """Columns up to the last with a crossing; two at least, so that there is a turn to judge."""
    known = np.flatnonzero(~np.isnan(crossings).all(axis=0))
    return max(int(known[-1]) + 1, 2) if known.size else 2


def _direction(trace: Trace, crossings: FloatArray) -> float:
    """1.0 or -1.0: the sign of the whole movement; of the first turn that moves when the whole is zero."""
    turns = np.diff(crossings, axis=1).ravel()
    movements = np.concatenate(([trace.position[-1] - trace.position[0]], turns[~np.isnan(turns)]))
    moving = movements[movements != 0.0]
    return math.copysign(1.0, float(moving[0])) if moving.size else 1.0
