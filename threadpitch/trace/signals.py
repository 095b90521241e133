"""Signals as machines give them -> continuous angle and position; what was done is listed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from threadpitch.compiled import compiled
from threadpitch.trace.choice import Chosen, angle_factor, position_factor
from threadpitch.trace.conditioned import Samples
from threadpitch.trace.recording import IntArray, TraceError
from threadpitch.trace.soundness import BLOCK, TURN, FloatArray, even

NEVER = 0.0  # as a period: the signal does not wrap
_COUNTERS = tuple(2.0**bits for bits in range(12, 33))  # counts, of encoders whose counter overflows
_LEAST_JUMP = 0.5  # of a period; a signal that moves further in a sample cannot be made continuous
_USUAL = 1000  # samples by which the usual interval of time is told
_GAP, _LEAST = 1.5, 1e-6  # usual intervals
_WINDOW = 0.25  # turns at most, over which signals are averaged where the latency is estimated
_CERTAIN = 5.0  # standard deviations by which both speeds must vary alike, window by window
_USUAL_FEED = 5.0  # median deviations of the feed's speed, beyond which it sets off or stops
_BLOCKS = 10  # of a recording, by which the uncertainty of the latency is told
_BEFORE = 50  # samples before a gap by which the speed is told


@dataclass(frozen=True)
class Signals:
    """What the two signals are, beyond their units.

    ``angle_wrap``: period of a wrapped angle in its own unit (360 for degrees, 65536 for a counter of 16 bits, the
    counts per turn for a count that the index resets); None = found by itself, 0 = never. ``position_wrap``: the same
    of the position, 0 = never. With ``screw_lead`` (m) the position is the angle of a motor, in rev, deg, rad or
    count (``position_counts_per_turn``): xi = screw_lead theta' / (360 gear_ratio), gear_ratio the motor's turns per
    turn of the screw. ``latency`` (s): the position was recorded so much later than the angle; NaN = estimate it.
    ``outlier`` (m): a single position that is farther than that from the line between its neighbours is put on it.
    ``synchronous``: passes are where the feed moves in step with the spindle, by ``lead`` (m per turn) where that is
    given.

    Raises:
        TraceError: a number is not finite, or not positive where it must be.
    """

    angle_wrap: float | None = None
    position_wrap: float = NEVER
    screw_lead: float | None = None
    gear_ratio: float = 1.0
    position_counts_per_turn: float | None = None
    latency: float = 0.0
    outlier: float | None = None
    synchronous: bool = False
    lead: float | None = None

    def __post_init__(self) -> None:
        positive = {"screw lead": self.screw_lead, "gear ratio": self.gear_ratio,
                    "position counts per turn": self.position_counts_per_turn, "outlier limit": self.outlier,
                    "lead": self.lead}
        for name, value in positive.items():
            if value is not None and not 0.0 < value < math.inf:
                raise TraceError(f"{name} is {value}; give a positive number")
        for name, value in {"angle wrap": self.angle_wrap, "position wrap": self.position_wrap}.items():
            if value is not None and not 0.0 <= value < math.inf:
                raise TraceError(f"{name} is {value}; give the period in the signal's unit, or 0 for none")

    @property
    def needs_the_whole(self) -> bool:
        """What is asked for cannot be done piece by piece: the latency is to be estimated."""
        return math.isnan(self.latency)

    def position_factor(self, unit: str) -> float:
        """``m = factor * value``."""
        if self.screw_lead is None:
            return position_factor(unit)
        try:
            motor = angle_factor(unit, self.position_counts_per_turn)
        except TraceError:
            if unit == "count":
                raise TraceError("the position is counts of the motor; give its counts per turn") from None
            raise TraceError(f"{unit!r} is not a unit of the motor's angle; with a screw lead the position is in rev, "
                             "deg, rad or count") from None
        return motor * self.screw_lead / (TURN * self.gear_ratio)

    def notes(self, chosen: Chosen) -> list[str]:
        """What is done to every group alike."""
        if self.screw_lead is None:
            return []
        gear = f", gear ratio {self.gear_ratio:g}" if self.gear_ratio != 1.0 else ""
        return [f"the position is the motor's angle in {chosen.position_unit} times the screw lead "
                f"{1e3 * self.screw_lead:g} mm{gear}"]


@dataclass
class Continuous:
    """Makes a wrapped signal continuous, piece by piece: each step is the nearest one modulo the period."""

    name: str
    period: float | None  # None = to be found
    turn: float  # one turn in the signal's unit; inf for a length
    counts: bool = False
    _lowest: float = math.inf
    _highest: float = -math.inf
    _last: float | None = None
    _offset: float = 0.0  # periods
    wraps: int = 0

    def add(self, values: FloatArray) -> FloatArray:
        """The next values (samples,), continuous with those before."""
        if self.period == NEVER or values.size == 0:
            return values
        first = float(values[0]) if self._last is None else self._last
        jump, lowest, highest = _until_a_jump(values, first, _LEAST_JUMP * (self.period or self.turn))
        if not math.isfinite(lowest) or not math.isfinite(highest):
            return values  # the trace refuses what is not finite
        self._last = float(values[-1])
        if self.period is None:
            self._lowest, self._highest = min(self._lowest, lowest), max(self._highest, highest)
            if jump < values.size:
                self._find(abs(float(values[jump] - (values[jump - 1] if jump else first))))
        if self.period is None or self.period == NEVER or (jump == values.size and self._offset == 0.0):
            return values
        periods = -np.rint(np.diff(values, prepend=first) / self.period)
        self.wraps += int(np.count_nonzero(periods))
        offsets = self._offset + np.cumsum(periods)
        self._offset = float(offsets[-1])
        return values + self.period * offsets

    @property
    def went_round(self) -> float:
        """Periods that were added, in either direction."""
        return abs(self._offset)

    def note(self, counted: bool = True) -> str:
        """What was done, with the number of wraps so far; empty for nothing."""
        if not self.wraps or self.period is None:
            return ""
        return (f"the {self.name} wraps at {self.period:.12g}: made continuous"
                + (f" over {self.wraps} wraps" if counted else ""))

    def _find(self, jump: float) -> None:
        """A period is that of a wrapped signal when no two values up to the first jump are farther apart."""
        for period in (self.turn, *(_COUNTERS if self.counts else ())):
            if self._highest - self._lowest <= period and _LEAST_JUMP * period < jump <= period:
                self.period = period
                return
        self.period = NEVER


@compiled(nogil=True)
def _until_a_jump(values: FloatArray, before: float, least: float) -> tuple[int, float, float]:
    """(first sample that is farther than ``least`` from the one before, lowest and highest up to there)."""
    lowest, highest = values[0], values[0]
    for first in range(0, values.size, BLOCK):
        block = values[first : first + BLOCK]
        last = block[block.size - 1]
        if even(block, before, 0.0, least):  # then its ends are its lowest and highest
            lowest, highest = min(lowest, block[0]), max(highest, last)
        elif even(block, before, -least, 0.0):
            lowest, highest = min(lowest, last), max(highest, block[0])
        else:
            for i in range(block.size):
                lowest, highest = min(lowest, block[i]), max(highest, block[i])
                if not abs(block[i] - before) <= least:
                    return first + i, lowest, highest
                before = block[i]
        before = last
    return values.size, lowest, highest


@dataclass
class Clock:
    """Counts missing samples, and finds those that are there twice (equal time, angle and position)."""

    duplicates: int = 0
    gaps: int = 0
    longest: float = 0.0
    turned: float = 0.0  # rad, at most in a place where samples are missing, by the speed before it
    _last: tuple[float, float, float] = (-math.inf, 0.0, 0.0)  # time, angle, position of the sample before
    _intervals: list[float] = field(default_factory=list)
    _usual: float = 0.0
    _tail: FloatArray = field(default_factory=lambda: np.empty((2, 0)))  # time and angle of the last samples

    def add(self, coming: Samples) -> NDArray[np.bool_] | None:
        """Which samples are kept (samples,) as True; None for all."""
        time = coming.time
        if time is None or time.size == 0:
            return None
        usual = len(self._intervals) >= _USUAL and even(time, self._last[0], _LEAST * self._usual, _GAP * self._usual)
        kept = None if usual else self._looked_at(coming, time)
        end = coming.part(slice(-_BEFORE, None))
        self._last = float(time[-1]), float(end.angle[-1]), float(end.position[-1])
        self._tail = np.concatenate((self._tail, (time[-_BEFORE:], end.angle)), axis=1)[:, -_BEFORE:]
        return kept

    def _looked_at(self, coming: Samples, time: FloatArray) -> NDArray[np.bool_] | None:
        steps = np.diff(time, prepend=self._last[0])
        long = self._gaps(steps)
        if long.size:
            self._turn_through(long, time, coming.angle)
        twice = steps == 0.0
        if not twice.any():
            return None
        twice &= np.diff(coming.angle, prepend=self._last[1]) == 0.0
        twice &= np.diff(coming.position, prepend=self._last[2]) == 0.0
        self.duplicates += int(np.count_nonzero(twice))
        return np.asarray(~twice)

    def notes(self) -> list[str]:
        """What was found."""
        found = []
        if self.duplicates:
            found.append(f"{self.duplicates} samples are there twice: left out")
        if self.gaps:
            found.append(f"samples are missing in {self.gaps} places, {self.longest:.4g} s at most: crossings in there "
                         "are interpolated over them")
            if self.turned > TURN:
                found.append(f"about {self.turned / TURN:.1f} turns passed while samples were missing: their P(n) are "
                             "the mean over the gap, and tell nothing of each")
        return found

    def _gaps(self, steps: FloatArray) -> IntArray:
        """The samples before which some are missing; counted."""
        if len(self._intervals) < _USUAL:
            forward = steps[np.isfinite(steps) & (steps > 0.0)]
            self._intervals += forward[: _USUAL - len(self._intervals)].tolist()
            self._usual = float(np.median(self._intervals)) if self._intervals else 0.0
        if self._usual <= 0.0:
            return np.empty(0, np.int64)
        long = np.flatnonzero((steps > _GAP * self._usual) & (steps < math.inf))
        self.gaps += long.size
        self.longest = max(self.longest, float(steps[long].max(initial=0.0)))
        return long

    def _turn_through(self, long: IntArray, time: FloatArray, angle: FloatArray) -> None:
        """How far the spindle turns where samples are missing, by its speed in the samples before each place."""
        before = self._tail.shape[1]
        times, angles = np.concatenate((self._tail, (time, angle)), axis=1)
        for sample in long[long + before > 1] + before:
            begin = max(0, sample - _BEFORE)
            passed = times[sample - 1] - times[begin]
            if passed > 0.0:
                speed = abs(angles[sample - 1] - angles[begin]) / passed
                self.turned = max(self.turned, float(speed * (times[sample] - times[sample - 1])))


def without_outliers(position: FloatArray, limit: float) -> tuple[FloatArray, IntArray]:
    """(the positions (samples,) m with single samples that stick out put between their neighbours, which these are).

    A neighbour of an outlier departs from its own neighbours by half as much: only the farthest one is moved.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # the trace refuses what is not finite
        middle = 0.5 * (position[:-2] + position[2:])
        out = np.abs(position[1:-1] - middle)
        farthest = out >= np.maximum(np.concatenate(([0.0], out[:-1])), np.concatenate((out[1:], [0.0])))
    places = np.flatnonzero((out > limit) & farthest) + 1
    if not places.size:
        return position, places
    mended = position.copy()
    mended[places] = middle[places - 1]
    return mended, places


def estimated_latency(time: FloatArray, angle: FloatArray, position: FloatArray) -> tuple[float, float]:
    """(tau, its standard uncertainty), s, of ``xi(t) = a + b theta(t - tau)``.

    It is found by least squares out of ``xi = a + b theta - b tau d theta/dt``. All are averaged over the same window,
    which leaves the equation true; what is left of tau, which moves the position by more than the first order, is found
    once more. The uncertainty is that of the jackknife over ``_BLOCKS`` parts of the recording, one of which is left
    out at a time. A feed that follows its command late looks the same: tau holds both.

    Raises:
        TraceError: the spindle's speed does not vary enough to tell.
    """
    turns = abs(angle[-1] - angle[0]) / TURN
    width = max(3, int(min(angle.size / 200, _WINDOW * angle.size / max(turns, 1.0))))
    window = np.ones(width) / width
    theta, xi, speed, feed = (np.convolve(values, window, mode="valid") for values in (
        angle - angle[0], position - position[0], np.gradient(angle, time), np.gradient(position, time)))
    if speed.std() < 1e-4 * abs(speed.mean()) or not _vary_alike(speed, feed, width):
        raise TraceError("the latency cannot be estimated: the spindle's speed does not vary; give it as a number")
    first, uncertainty = _late(theta, speed, xi)
    instants = time[width // 2 : width // 2 + xi.size]
    there = (instants + first >= instants[0]) & (instants + first <= instants[-1])
    if there.sum() < xi.size // 2:
        return first, uncertainty
    rest, uncertainty = _late(theta[there], speed[there], np.interp(instants[there] + first, instants, xi))
    return first + rest, uncertainty


def _late(theta: FloatArray, speed: FloatArray, xi: FloatArray) -> tuple[float, float]:
    matrix = np.column_stack([np.ones(theta.size), theta - theta.mean(), speed - speed.mean()])
    matrix /= np.maximum(np.abs(matrix).max(axis=0), np.finfo(np.float64).tiny)
    parts = [(rows.T @ rows, rows.T @ values) for rows, values in zip(
        np.array_split(matrix, _BLOCKS), np.array_split(xi, _BLOCKS), strict=True)]
    scale = float(np.abs(theta - theta.mean()).max() / np.abs(speed - speed.mean()).max())

    def late(used: list[tuple[FloatArray, FloatArray]]) -> float:
        _, per_angle, per_speed = np.linalg.lstsq(sum(one for one, _ in used), sum(one for _, one in used))[0]
        return float(-scale * per_speed / per_angle) if per_angle != 0.0 else 0.0

    without = np.array([late([*parts[:k], *parts[k + 1 :]]) for k in range(_BLOCKS)])
    return late(parts), float(np.sqrt((_BLOCKS - 1.0) / _BLOCKS * np.sum((without - without.mean()) ** 2)))


def _vary_alike(speed: FloatArray, feed: FloatArray, width: int) -> bool:
    """Whether two speeds (samples,), averaged over so many samples, vary together: what is only the noise of a
    quantised angle, the feed does not show. Where the feed sets off or stops is left out.
    """
    beside = np.abs(feed - np.median(feed))
    usual = beside <= _USUAL_FEED * np.median(beside)
    if usual.sum() < 2 or feed[usual].std() == 0.0:
        return False
    both = float(np.corrcoef(speed[usual], feed[usual])[0, 1])
    return both**2 * int(usual.sum()) / width > _CERTAIN**2
