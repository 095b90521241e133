"""Where the feed moves in step with the spindle: the passes of a recording that has no flag for them.

Over every eighth of a turn (a cell) the movement per turn is

    F_k = 2 pi (xi_(k+1) - xi_k) / (theta_(k+1) - theta_k)

A stretch is synchronous while F_k stays within 15 % of its mean so far. It is a pass as soon as it has lasted for a
turn and a half and its F is the lead: the one that is given, else that in which the spindle has made most turns so far.
A pass begins where the feed sets off before the stretch, and ends where it leaves the lead: with the samples of the
first cell that leaves it as long as they keep to the lead within 5 %.

All of this is decided by samples that came before, so that a recording that grows has the passes of the finished one.
Within a pass a sample is known to belong to it at once while it keeps to the lead within 5 %, else when its cell does.

An angle that falls back by more than a turn, as it does where a control sets it to zero at the index, begins anew.

A feed at constant speed beside an even spindle looks the same: where it makes more turns than the thread, the lead has
to be given.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from threadpitch.trace.soundness import TURN, FloatArray

CELL = TURN / 8.0  # rad
TOLERANCE = 0.15  # of the movement per turn
LEAST_TURNS = 1.5
HELD = 1 << 21  # samples before a pass is known, of which it may consist; it begins later where they were more
_AT_ONCE = 0.05  # of the movement per turn; a sample within that is of the pass, whatever becomes of its cell
_STANDING = 0.02  # of the lead: the feed has not set off
_SMALLEST = 1e-6  # m per turn, of a feed that moves
_SETTING_OFF = 128  # cells; in so many the feed has come up to speed


@dataclass(frozen=True)
class Part:
    """Samples from ``first`` up to ``last`` of a pass, the first of it or those that follow."""

    first: int
    last: int
    opens: bool
    movement: float  # m per turn


@dataclass(frozen=True)
class Stretch:
    """A pass: samples from ``first`` up to ``last`` in which the feed moves ``movement`` m per turn."""

    first: int
    last: int
    movement: float


@dataclass(frozen=True)
class _Border:
    """The first sample of a cell."""

    sample: int
    peak: float  # rad, greatest angle so far
    position: float  # m


@dataclass
class _Steady:
    """Neighbouring cells with one movement per turn."""

    begin: float = 0.0  # rad
    cells: int = 0
    movement: float = math.nan  # m per turn, mean
    turns: float = 0.0

    def takes(self, movement: float, end: float) -> bool:
        """Whether a cell belongs to it; then it is counted."""
        if not (self.cells and abs(movement - self.movement) <= TOLERANCE * abs(self.movement)):
            return False
        self.cells += 1
        self.movement += (movement - self.movement) / self.cells
        self.turns = (end - self.begin) / TURN
        return True


class Synchronism:
    """Finds the passes of a recording piece by piece, as parts that follow one another.

    ``lead``: m per turn; with a sign, of a movement in that direction where ``signed``. ``from_the_start``: there is
    one pass, which begins with the first sample.
    """

    def __init__(self, lead: float | None = None, *, signed: bool = False, from_the_start: bool = False) -> None:
        self._lead, self._signed, self._from_the_start = lead, signed, from_the_start
        self._size = 0  # samples so far
        self._peak = math.nan  # rad
        self._borders: deque[_Border] = deque(maxlen=_SETTING_OFF + 1)
        self._movements: deque[float] = deque(maxlen=_SETTING_OFF)  # m per turn, of the cells between them
        self._since = 0  # sample from which on the angle has not begun anew
        self._forgotten = False  # there were cells before the first border
        self._steady = _Steady()
        self._turns: list[tuple[float, float]] = []  # of each movement per turn in stretches that are over
        self._open = False
        self._over = False  # no pass can come any more
        self._told = 0  # samples up to which all is known
        self._at_once = True  # in this cell all samples so far keep to the lead

    @property
    def needed(self) -> int:
        """The first sample that a part that is still to come may have."""
        if self._open:
            return self._told
        if self._over:
            return self._size
        earliest = self._borders[0].sample if self._forgotten else self._since
        return max(self._told, self._size - HELD, 0 if self._from_the_start else earliest)

    def add(self, angle: FloatArray, position: FloatArray) -> list[Part]:
        """The parts that are known with the next samples, angle (samples,) rad counted up, position (samples,) m."""
        parts: list[Part] = []
        while angle.size:
            end = self._until_it_begins_anew(angle)
            parts += self._add(angle[:end], position[:end])
            angle, position = angle[end:], position[end:]
            if angle.size:
                self._begin_anew()
        return _joined(parts)

    def _until_it_begins_anew(self, angle: FloatArray) -> int:
        """How many samples there are before the angle falls back by more than a turn."""
        if self._from_the_start:
            return angle.size
        before = np.fmax.accumulate(np.concatenate(([self._peak], angle[:-1])))
        with np.errstate(invalid="ignore"):
            back = np.flatnonzero(angle < before - TURN)
        return int(back[0]) if back.size else angle.size

    def _begin_anew(self) -> None:
        self._finish()
        self._steady, self._peak = _Steady(), math.nan
        self._borders.clear()
        self._movements.clear()
        self._told = self._since = self._size
        self._forgotten = False

    def _add(self, angle: FloatArray, position: FloatArray) -> list[Part]:
        if angle.size == 0:
            return []
        peak = np.fmax.accumulate(np.concatenate(([self._peak], angle)))  # damage outside of the passes does not matter
        with np.errstate(invalid="ignore"):
            cell = np.floor(peak / CELL)
            borders = np.flatnonzero(cell[1:] > cell[:-1]).tolist()
        parts: list[Part] = []
        seen = 0
        for border in borders:
            if not self._over:
                upto = border + 1
                parts += self._close_cell(_Border(self._size + border, float(peak[upto]), float(position[border])),
                                          peak[seen : upto + 1], position[seen:upto])
            seen = border + 1
        if self._open:
            parts += self._up_to(self._kept(self._size + seen, peak[seen:], position[seen:]))
        self._size += angle.size
        self._peak = float(peak[-1])
        return parts

    def end(self) -> list[Part]:
        """The recording is over; what follows the last cell of a pass is part of it."""
        rest = self._up_to(self._size) if self._open else []
        self._finish()
        return rest

    def chief(self) -> float | None:
        """The movement per turn in which the spindle made most turns, m, signed; None where there is none."""
        return max(self._turns, key=lambda one: one[1])[0] if self._turns else None

    def _close_cell(self, border: _Border, peak: FloatArray, position: FloatArray) -> list[Part]:
        """A cell ends; ``peak`` (samples + 1,) and ``position`` (samples,) are those of it that came just now."""
        if not self._borders:
            self._borders.append(border)
            return []
        before = self._borders[-1]
        movement = TURN * (border.position - before.position) / (border.peak - before.peak)
        parts: list[Part] = []
        if not self._steady.takes(movement, border.peak):
            if self._open:
                parts = self._up_to(self._kept(border.sample + 1 - position.size, peak, position))
            self._finish()
            self._steady = _Steady(before.peak, 1, movement, (border.peak - before.peak) / TURN)
        self._forgotten |= len(self._borders) == self._borders.maxlen
        self._borders.append(border)
        self._movements.append(movement)
        self._at_once = True
        if self._open:
            parts += self._up_to(border.sample + 1)
        elif not self._over and self._is_pass():
            self._open = True
            first = max(self._beginning(), self._told, border.sample + 1 - HELD)
            self._told = border.sample + 1
            parts.append(Part(first, self._told, opens=True, movement=self._steady.movement))
        return parts

    def _finish(self) -> None:
        """The stretch is over, and the pass that it was."""
        steady = self._steady
        if steady.turns >= LEAST_TURNS and abs(steady.movement) >= _SMALLEST:
            self._turns = _counted(self._turns, steady)
        if self._open:
            self._open, self._over = False, self._from_the_start
            while len(self._borders) > 1:  # the next pass cannot begin in this one
                self._borders.popleft()
            self._movements.clear()
            self._forgotten = True

    def _is_pass(self) -> bool:
        steady = self._steady
        if steady.turns < LEAST_TURNS or not abs(steady.movement) >= _SMALLEST:
            return False
        if self._lead is not None:
            movement = steady.movement if self._signed else abs(steady.movement)
            return abs(movement - self._lead) <= TOLERANCE * abs(self._lead)
        if self._from_the_start:
            return True
        turns = _counted(self._turns, steady)
        return _alike(max(turns, key=lambda one: one[1])[0], steady.movement)

    def _beginning(self) -> int:
        """The sample at which the feed sets off."""
        if self._from_the_start:
            return 0
        share = [movement / self._steady.movement for movement in self._movements]
        begin = max(len(share) - self._steady.cells, 0)
        while begin > 0 and _STANDING < share[begin - 1] < 1.0 + TOLERANCE:
            begin -= 1
        if begin > 0 and abs(share[begin - 1]) <= _STANDING:
            begin -= 1
        return self._borders[begin].sample if begin > 0 or self._forgotten else self._since

    def _kept(self, first: int, peak: FloatArray, position: FloatArray) -> int:
        """The sample up to which an open cell keeps to the lead; peak (samples + 1,) from that before ``first`` on,
        position (samples,).

        Only where the angle rises; what stands still can complete no turn.
        """
        if not self._at_once or len(self._borders) < 2:
            return self._told
        since = self._borders[-2]
        with np.errstate(invalid="ignore"):
            movement = TURN * (position - since.position) / (peak[1:] - since.peak)
            keeps = np.abs(movement - self._steady.movement) <= _AT_ONCE * abs(self._steady.movement)
        keeps |= ~(peak[1:] > peak[:-1])
        self._at_once = bool(keeps.all())
        return first + (keeps.size if self._at_once else int(np.argmin(keeps)))

    def _up_to(self, last: int) -> list[Part]:
        first, self._told = self._told, max(self._told, last)
        return [Part(first, last, opens=False, movement=self._steady.movement)] if last > first else []


def synchronous_passes(angle: FloatArray, position: FloatArray, lead: float | None = None) -> list[Stretch]:
    """The passes of a recording, angle (samples,) rad counted up, position (samples,) m; empty where there is none.

    Without a ``lead`` (m per turn) it is that in which the spindle makes most turns.
    """
    signed = lead is None
    if lead is None:
        lead = _chief_lead(angle, position)
        if lead is None:
            return []
    finder = Synchronism(lead, signed=signed)
    found: list[Stretch] = []
    for part in [*finder.add(angle, position), *finder.end()]:
        first = part.first if part.opens else found.pop().first
        found.append(Stretch(first, part.last, part.movement))
    return found


def _chief_lead(angle: FloatArray, position: FloatArray) -> float | None:
    finder = Synchronism()
    finder.add(angle, position)
    finder.end()
    return finder.chief()


def _counted(turns: list[tuple[float, float]], steady: _Steady) -> list[tuple[float, float]]:
    """The turns of each movement per turn, with those of one more stretch."""
    for k, (movement, made) in enumerate(turns):
        if _alike(movement, steady.movement):
            return [*turns[:k], (movement, made + steady.turns), *turns[k + 1 :]]
    return [*turns, (steady.movement, steady.turns)]


def _alike(one: float, other: float) -> bool:
    return abs(one - other) <= TOLERANCE * abs(other)


def _joined(parts: list[Part]) -> list[Part]:
    """Parts that follow one another within a pass, as one."""
    found: list[Part] = []
    for part in parts:
        if found and not part.opens and part.first == found[-1].last:
            part = Part(found[-1].first, part.last, found[-1].opens, part.movement)
            found.pop()
        found.append(part)
    return found
