"""Where the feed moves in step with the spindle: the passes of a recording that has no flag for them.

Over every eighth of a turn the movement per turn is

    F_k = 2 pi (xi_(k+1) - xi_k) / (theta_(k+1) - theta_k)

A stretch is synchronous while F_k stays within 15 % of its mean, for a turn and a half at least. The passes are those
stretches whose F is the lead: the one that is given, else that in which the spindle makes most turns. A pass begins
where the feed sets off before the stretch, and ends where it leaves the lead.

A feed at constant speed beside an even spindle looks the same: where it makes more turns than the thread, the lead has
to be given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from threadpitch.trace.recording import IntArray
from threadpitch.trace.soundness import TURN, FloatArray

CELL = TURN / 8.0  # rad
TOLERANCE = 0.15  # of the movement per turn
LEAST_TURNS = 1.5
_STANDING = 0.02  # of the lead: the feed has not set off
_SMALLEST = 1e-6  # m per turn, of a feed that moves


@dataclass(frozen=True)
class Stretch:
    """Samples from ``first`` up to ``last`` in which the feed moves ``movement`` m per turn."""

    first: int
    last: int
    movement: float
    turns: float


@dataclass(frozen=True, eq=False)
class _Cells:
    """Borders (cells + 1,) as samples, and movements per turn (cells,) m between them."""

    borders: IntArray
    angle: FloatArray  # (cells + 1,) rad
    movement: FloatArray

    def stretch(self, begin: int, end: int) -> Stretch:
        """The cells from ``begin`` up to ``end``."""
        turns = float(self.angle[end] - self.angle[begin]) / TURN
        return Stretch(begin, end, float(np.mean(self.movement[begin:end])), turns)


def synchronous_passes(angle: FloatArray, position: FloatArray, lead: float | None = None) -> list[Stretch]:
    """The passes of a recording, angle (samples,) rad counted up, position (samples,) m; empty where there is none."""
    cells = _cells(angle, position)
    stretches = [one for one in _steady(cells) if one.turns >= LEAST_TURNS and abs(one.movement) >= _SMALLEST]
    if lead is not None:
        stretches = [one for one in stretches if abs(abs(one.movement) - lead) <= TOLERANCE * lead]
    if not stretches:
        return []
    chief = max(stretches, key=lambda one: sum(other.turns for other in stretches if _alike(other, one)))
    return [_with_its_beginning(cells, one, angle.size) for one in stretches if _alike(one, chief)]


def _cells(angle: FloatArray, position: FloatArray) -> _Cells:
    with np.errstate(invalid="ignore"):
        peak = np.fmax.accumulate(angle)  # a damaged sample outside of the passes does not matter
        borders = np.flatnonzero(np.diff(np.floor(peak / CELL)) > 0.0) + 1
        movement = TURN * np.diff(position[borders]) / np.diff(peak[borders])
    return _Cells(borders, peak[borders], movement)


def _steady(cells: _Cells) -> list[Stretch]:
    """All stretches, as cells, in which the movement per turn stays the same."""
    found: list[Stretch] = []
    begin, mean = 0, 0.0
    for k, movement in enumerate([*cells.movement.tolist(), float("nan")]):
        count = k - begin
        if count and abs(movement - mean) <= TOLERANCE * abs(mean):
            mean += (movement - mean) / (count + 1)
            continue
        if count:
            found.append(cells.stretch(begin, k))
        begin, mean = k, movement
    return found


def _alike(one: Stretch, other: Stretch) -> bool:
    return abs(one.movement - other.movement) <= TOLERANCE * abs(other.movement)


def _with_its_beginning(cells: _Cells, stretch: Stretch, size: int) -> Stretch:
    """The stretch as samples, from where the feed sets off."""
    share = cells.movement / stretch.movement
    begin = stretch.first
    while begin > 0 and _STANDING < share[begin - 1] < 1.0 + TOLERANCE:
        begin -= 1
    if begin > 0 and abs(share[begin - 1]) <= _STANDING:
        begin -= 1
    first = int(cells.borders[begin]) if begin > 0 else 0
    last = int(cells.borders[stretch.last]) + 1 if stretch.last < share.size else size
    return Stretch(first, last, stretch.movement, stretch.turns)
