"""P(n) while the samples come: the same bits, however they are cut into pieces."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.pitch.kernel import PEAK, POSITION, ROUNDING, advance, columns_reached, first_above, movements
from threadpitch.pitch.table import BoolArray, PitchError, PitchTable
from threadpitch.trace import LARGEST, REVERSAL_LIMIT, TURN, FloatArray, IntArray, TraceError, samples, scaled
from threadpitch.trace.soundness import fault_text

FARTHEST_ZERO = 100  # turns; an angle zero farther away is that of a counter, no longer that of this thread
MOST_TURNS_PER_SAMPLE = 1000.0
UNNAMED = "trace"  # what a recording without a name is called
_BEGINNING = 1 << 12  # samples
TWO_THREADS_FROM = 1 << 20  # samples; below that a second thread costs more than it gives


class PitchStream:
    """Takes a recording piece by piece; ``table()`` is what ``thread_pitch`` gives for the whole of it.

        stream = PitchStream()
        for angle, position in pieces:
            stream.add(angle, position)
        table = stream.table()

    Memory grows with the turns, not with the samples. ``completed`` (start_angles,) is the number n of the last turn
    that is complete, ``pitch_of(k, n)`` its P(n).

    Args:
        start_angles: theta_S (start_angles,) rad, from angle zero as given; None = at the first sample.
        limit: how far the angle may go back from its peak, rad.
        label: what to call the recording in a message.
        source: its file, where the samples come with their lines.
        margin: turns are counted from the first sample less this, rad, when that is more than a turn away from angle
            zero, as it is in a pass of a longer recording; None = from angle zero, up to 100 turns.

    Raises (the class itself):
        PitchError: start angles that are no finite numbers within 100 turns.
    """

    def __init__(self, start_angles: ArrayLike | None = (0.0,), *, limit: float = REVERSAL_LIMIT,
                 label: str = UNNAMED, source: str = "", margin: float | None = None) -> None:
        self._asked = None if start_angles is None else _start_angles(start_angles)
        self._limit = limit
        self._label = label
        self._source = source
        self._margin = margin
        self._size = 0  # samples so far
        self._before = 0  # whole turns between angle zero and the beginning of n = 1
        self._first = np.empty(2)  # angle, position of the first sample
        self._risen = False  # a sample had a greater angle than the first
        self._last = np.empty(3)  # angle, position, peak
        self._starts = np.empty(0) if self._asked is None else self._asked
        none = np.zeros(self._starts.size, np.int64)
        self._known, self._reached = none, none.copy()  # crossings from known up to reached are in the trace
        self._extrapolated: BoolArray = np.zeros(self._starts.size, np.bool_)
        self._crossings = np.empty((self._starts.size, 0))

    @property
    def size(self) -> int:
        """Samples so far."""
        return self._size

    @property
    def start_angles(self) -> FloatArray:
        """(start_angles,) rad; empty before the first sample of a stream that starts there."""
        return self._starts if self._size or self._asked is None else self._asked

    @property
    def turns_before(self) -> int:
        """Whole turns between angle zero and the beginning of n = 1."""
        return self._before

    @property
    def completed(self) -> IntArray:
        """(start_angles,) number n of the last complete turn, 0 before the first."""
        return np.where(self._reached - self._known > 1, self._reached - 1, 0)

    def pitch_of(self, start: int, turn: int) -> float:
        """P(n) of a turn that is complete, n from 1; NaN when it began before the trace.

        The sign is that of the feed so far.

        Raises:
            IndexError: the turn is not complete.
        """
        if not 1 <= turn <= self.completed[start]:
            raise IndexError(f"turn {turn} of start angle {start} is not complete")
        return float(self._direction() * (self._crossings[start, turn] - self._crossings[start, turn - 1]) + 0.0)

    def add(self, angle: ArrayLike, position: ArrayLike, lines: IntArray | None = None, *,
            factors: tuple[float, float] = (1.0, 1.0)) -> None:
        """The next samples: angle (samples,) rad, position (samples,) m, ``lines`` (samples,) of the file.

        With ``factors`` the angle is in units of so many rad, the position in units of so many m.

        Raises:
            TraceError: unequal shapes, NaN or infinite values, a reversal of the spindle; with the sample's number.
            PitchError: more turns than the samples can hold.
        """
        theta, xi = samples("angle", angle, self._label), samples("position", position, self._label)
        if theta.size != xi.size:
            raise TraceError(f"{self._label}: position has {xi.size} samples and angle {theta.size}; give equal "
                             "lengths")
        done = 0
        while done < theta.size and not self._risen and factors != (1.0, 1.0):  # looked at more closely, in rad and m
            part = slice(done, done + _BEGINNING)
            self._take(scaled(theta[part], factors[0]), scaled(xi[part], factors[1]), None if lines is None
                       else lines[part], (1.0, 1.0))
            done += _BEGINNING
        if done < theta.size:
            self._take(theta[done:], xi[done:], None if lines is None else lines[done:], factors)

    def _take(self, theta: FloatArray, xi: FloatArray, lines: IntArray | None, factors: tuple[float, float]) -> None:
        if self._size == 0:
            self._begin(theta, xi, lines)
        end = float(theta[-1]) * factors[0]
        room = self._reserve(end, theta.size)
        refused = self._advance(theta, xi, factors)
        if refused >= 0:
            self._refuse(scaled(theta, factors[0]), scaled(xi, factors[1]), refused, lines)
        if not room:
            turned = (end - self._first[0]) / TURN
            raise PitchError(f"{self._label}: {turned:.3g} turns in {self._size + theta.size} samples; "
                             "is the unit of the angle right?")
        if not self._risen:
            self._rise(theta, xi)
        self._size += theta.size

    def table(self) -> PitchTable:
        """P(n) of all samples so far.

        Raises:
            PitchError: less than one whole turn.
        """
        return self._table(self._crossings.copy())

    def final_table(self) -> PitchTable:
        """``table()`` without a copy: nothing can be added after it."""
        return self._table(self._crossings)

    def _table(self, crossings: FloatArray) -> PitchTable:
        turned = (self._last[PEAK] - self._first[0]) / TURN if self._size else 0.0
        if turned < 1.0 - ROUNDING:
            raise PitchError(f"{self._label}: the spindle turns {turned:.4g} of a turn; a pitch needs a whole one "
                             "(is the unit of the angle right?)")
        if not (self._reached - self._known > 1).any():
            raise PitchError(f"{self._label}: no start angle has a whole turn between {self._first[0] / TURN:.4g} and "
                             f"{self._last[PEAK] / TURN:.4g} turns; choose a smaller start angle")
        columns = int(self._reached[self._reached > self._known].max())
        for row, reached in zip(crossings, self._reached, strict=True):
            row[reached:columns] = np.nan
        crossings = crossings[:, :columns]
        pitch = np.empty((crossings.shape[0], columns - 1))
        movements(crossings, self._direction(), pitch)
        return PitchTable(self._starts, pitch, crossings, self._extrapolated.copy(), self._before)

    def _begin(self, theta: FloatArray, xi: FloatArray, lines: IntArray | None) -> None:
        if not (abs(theta[0]) <= LARGEST and abs(xi[0]) <= LARGEST):
            self._refuse(theta, xi, 0, lines)
        self._first[:] = theta[0], xi[0]
        self._last[:] = theta[0], xi[0], theta[0]
        if self._asked is None:
            self._starts = theta[:1].copy()
        distance = (float(theta[0]) - float(self._starts.min())) / TURN
        self._before = 0
        if self._margin is not None and abs(distance) > 1.0:
            levels = (float(theta[0]) - self._margin - self._starts) / TURN
            self._before = math.ceil(float(levels.min()) - ROUNDING * abs(distance))
        elif abs(distance) > FARTHEST_ZERO:
            self._before = math.floor(distance * (1.0 + ROUNDING))
        self._known = columns_reached(float(theta[0]), self._starts, self._before)
        self._reached = self._known.copy()
        self._extrapolated = np.zeros(self._starts.size, np.bool_)
        self._crossings = np.empty((self._starts.size, 0))

    def _rise(self, theta: FloatArray, xi: FloatArray) -> None:
        """The levels that the first sample had reached, once it is known how far the angle moves in a sample.

        xi(level) is that of the first sample, or extrapolated from the first two different angles, or NaN when the
        first sample is past the level by as much as the angle between these two.
        """
        second = first_above(theta, float(self._first[0]))
        if second == theta.size:
            return
        self._risen = True
        angle, position = self._first
        step = float(theta[second]) - angle
        columns = int(self._known.max())
        levels = self._starts[:, np.newaxis] + TURN * (self._before + np.arange(columns))
        slack = ROUNDING * np.maximum(np.abs(levels), TURN)
        passed = angle - levels  # (start_angles, columns) rad
        just_passed = (passed > slack) & (passed < step - slack)
        extended = position - passed / step * (float(xi[second]) - position)
        early = np.select([passed < -slack, passed <= slack, just_passed], [np.nan, position, extended], np.nan)
        there = np.arange(columns) < self._known[:, np.newaxis]
        self._crossings[:, :columns] = np.where(there, early, self._crossings[:, :columns])
        self._known -= np.count_nonzero(there & ~np.isnan(early), axis=1)
        self._extrapolated = np.any(just_passed & there, axis=1)

    def _reserve(self, end: float, size: int) -> bool:
        """Room for all crossings of the piece; false when it has more turns than its samples can hold."""
        turned = (end + self._limit - self._last[PEAK]) / TURN
        if not turned <= MOST_TURNS_PER_SAMPLE * (self._size + size) + FARTHEST_ZERO:
            return False
        columns = int(self._reached.max()) + math.floor(max(turned, 0.0)) + 3
        if columns > self._crossings.shape[1]:
            crossings = np.empty((self._starts.size, max(columns, 2 * self._crossings.shape[1])))
            crossings[:, : self._crossings.shape[1]] = self._crossings
            self._crossings = crossings
        return True

    def _advance(self, theta: FloatArray, xi: FloatArray, factors: tuple[float, float]) -> int:
        """The sample that is refused, or -1; the second half of a large piece has a thread of its own."""
        middle = theta.size // 2
        peak = float(theta[middle - 1]) * factors[0]  # supposed: it is when the angle does not go back just there
        usual = self._last[PEAK] <= peak + self._limit and peak <= theta[-1] * factors[0] + self._limit
        if theta.size < TWO_THREADS_FROM or not usual:
            return self._walk(theta, xi, factors, self._last, self._reached)
        last = np.array([peak, xi[middle - 1] * factors[1], peak])
        reached = np.maximum(columns_reached(peak, self._starts, self._before), self._known)
        with ThreadPoolExecutor(max_workers=1) as second:
            rest = second.submit(self._walk, theta[middle:], xi[middle:], factors, last, reached)
            refused = self._walk(theta[:middle], xi[:middle], factors, self._last, self._reached)
            behind = rest.result()
        if refused >= 0:
            return refused
        if self._last[PEAK] != peak:  # once more, from where the first half really ends
            last, reached = self._last, self._reached
            behind = self._walk(theta[middle:], xi[middle:], factors, last, reached)
        self._last, self._reached = last, reached
        return middle + behind if behind >= 0 else -1

    def _walk(self, theta: FloatArray, xi: FloatArray, factors: tuple[float, float], last: FloatArray,
              reached: IntArray) -> int:
        return int(advance(theta, xi, factors, last, self._limit, self._starts, self._before, reached,
                           self._crossings))

    def _refuse(self, theta: FloatArray, xi: FloatArray, sample: int, lines: IntArray | None) -> NoReturn:
        before = float(self._last[PEAK]) if self._size else -math.inf
        peak = float(theta[:sample].max(initial=before))
        place = f"sample {self._size + sample}"
        if lines is not None:
            place = f"{self._source}:{lines[sample]}"
        elif self._label != UNNAMED:
            place = f"{self._label}: {place}"
        if self._size:  # the direction is that of the whole, not of a few samples
            theta, xi, sample = np.insert(theta, 0, self._first[0]), np.insert(xi, 0, self._first[1]), sample + 1
        raise TraceError(f"{place}: {fault_text(theta, xi, sample, peak)}")

    def _direction(self) -> float:
        """1.0 or -1.0: the sign of the whole movement; of the first turn that moves when the whole is zero."""
        movement = float(self._last[POSITION] - self._first[1])
        if movement == 0.0:
            turns = [np.diff(row[known:reached]) for row, known, reached
                     in zip(self._crossings, self._known, self._reached, strict=True)]
            moving = np.concatenate(turns)
            moving = moving[moving != 0.0]
            movement = float(moving[0]) if moving.size else 1.0
        return math.copysign(1.0, movement)


def _start_angles(start_angles: ArrayLike) -> FloatArray:
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
    return np.ascontiguousarray(starts)
