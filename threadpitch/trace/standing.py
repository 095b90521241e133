"""Stretches in which the angle stands still while the position moves: a sensor that is stuck."""

from __future__ import annotations

from dataclasses import dataclass

from threadpitch.compiled import compiled
from threadpitch.trace.conditioned import Samples
from threadpitch.trace.soundness import TURN, FloatArray

_STRIDE = 8  # samples; every cache line is looked at once
_LEAST = 2 * _STRIDE  # samples in a stretch; a turn of fewer can hardly be measured


@dataclass(frozen=True)
class _Sample:
    """Where a sample stands."""

    number: int  # in the group, from 0
    value: float  # of the angle, as it is given
    angle: float  # rad
    position: float  # m
    time: float | None  # s
    line: int | None

    @property
    def place(self) -> str:
        where = f"sample {self.number}" if self.line is None else f"line {self.line}"
        return where if self.time is None else f"{where} ({self.time:.6g} s)"


@dataclass
class Standing:
    """Whether the angle stands still while the position moves by more than in a turn, piece by piece.

    Of several stretches within the group that with the greatest movement is told, and that at the end.
    """

    _size: int = 0  # samples so far
    _begin: _Sample | None = None
    _since: _Sample | None = None  # the first sample with the angle of the last one
    _last: _Sample | None = None
    _longest: tuple[_Sample, _Sample] | None = None  # ends of a stretch after which the angle goes on

    def add(self, coming: Samples) -> None:
        """The next samples."""
        if coming.size == 0:
            return
        first = self._sample(coming, 0)
        self._begin = self._begin or first
        equal = 0
        if self._since is not None and self._since.value == first.value:
            equal = _equal_at_the_beginning(coming.angle_values)
        if self._since is not None and self._last is not None and equal < coming.size:
            self._note(self._since, self._sample(coming, equal - 1) if equal else self._last)
        if self._since is None or equal < coming.size:
            tail = coming.size - _equal_at_the_end(coming.angle_values)
            inner = _greatest(coming.angle_values, coming.position_values, coming.position_factor, (equal, tail))
            if inner[0] >= 0:
                self._note(self._sample(coming, inner[0]), self._sample(coming, inner[1]))
            self._since = self._sample(coming, tail)
        self._last = self._sample(coming, coming.size - 1)
        self._size += coming.size

    def notes(self) -> list[str]:
        """That it stands while the position moves by more than in a turn."""
        found = []
        if self._longest is not None:
            begin, end = self._longest
            if self._is_far(begin, end):
                found.append(f"the angle stands still from {begin.place} to {end.place}, {self._turns(begin):.1f} "
                             f"turns after the first sample, while the position moves by {_moved_mm(begin, end):.4g} "
                             "mm: is its sensor stuck, or did the spindle stop? P(n) of that turn holds this movement "
                             "too")
        if self._since is not None and self._last is not None and self._is_far(self._since, self._last):
            found.append(f"the angle stands still at the end, while the position moves by "
                         f"{_moved_mm(self._since, self._last):.4g} mm: is its sensor stuck, or did the spindle stop?")
        return found

    def _note(self, begin: _Sample, end: _Sample) -> None:
        if end.number - begin.number + 1 < _LEAST:
            return
        if self._longest is None or _moved_mm(begin, end) > _moved_mm(*self._longest):
            self._longest = begin, end

    def _is_far(self, begin: _Sample, end: _Sample) -> bool:
        """Whether the position moves between these by more than elsewhere in a turn."""
        assert self._begin is not None
        assert self._last is not None
        turns = self._turns(self._last)
        elsewhere = abs(begin.position - self._begin.position) + abs(self._last.position - end.position)
        return turns >= 1.0 and abs(end.position - begin.position) > elsewhere / turns > 0.0

    def _turns(self, sample: _Sample) -> float:
        assert self._begin is not None
        return abs(sample.angle - self._begin.angle) / TURN

    def _sample(self, coming: Samples, place: int) -> _Sample:
        value = float(coming.angle_values[place])
        return _Sample(self._size + place, value, value * coming.angle_factor,
                       float(coming.position_values[place]) * coming.position_factor,
                       None if coming.time is None else float(coming.time[place]),
                       None if coming.lines is None else int(coming.lines[place]))


def _moved_mm(begin: _Sample, end: _Sample) -> float:
    return 1e3 * abs(end.position - begin.position)


@compiled(nogil=True)
def _greatest(angle: FloatArray, position: FloatArray, factor: float, part: tuple[int, int]) -> tuple[int, int]:
    """First and last sample of the stretch of equal angles with the greatest movement, in a part of the samples.

    Every stretch of ``_LEAST`` samples holds two neighbours of those that are looked at; (-1, -1) where there is none.
    """
    begin, end = part
    first, last, greatest = -1, -1, -1.0
    i = begin + _STRIDE
    while i < end:
        if angle[i] != angle[i - _STRIDE]:
            i += _STRIDE
            continue
        since, until = i, i
        while since > begin and angle[since - 1] == angle[i]:
            since -= 1
        while until + 1 < end and angle[until + 1] == angle[i]:
            until += 1
        moved = abs(position[until] * factor - position[since] * factor)
        if until - since + 1 >= _LEAST and moved > greatest:
            first, last, greatest = since, until, moved
        i = until + _STRIDE
    return first, last


@compiled(nogil=True)
def _equal_at_the_beginning(values: FloatArray) -> int:
    """How many of the first values are equal."""
    equal = 1
    while equal < values.size and values[equal] == values[0]:
        equal += 1
    return equal


@compiled(nogil=True)
def _equal_at_the_end(values: FloatArray) -> int:
    """How many of the last values are equal."""
    equal = 1
    while equal < values.size and values[values.size - 1 - equal] == values[values.size - 1]:
        equal += 1
    return equal
