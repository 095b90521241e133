"""Which measured turn is which nominal one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from threadpitch.judgement.verdict import JudgementError
from threadpitch.pitch import PitchTable
from threadpitch.trace import TURN, FloatArray

LARGEST = 10.0  # m, of a pitch; what is larger is damaged, and squares stay finite
_ASTRAY = 0.3  # of a lead: so far may a measured place be from the turn that it is taken for


@dataclass(frozen=True, eq=False)
class MeasuredThread:
    """Pitches of a real thread, and where on it they were measured.

    ``turn`` numbers the turns as the nominal table does; ``position`` is the middle between the two grooves along the
    axis, in the coordinate of the feed. NaN is a turn that was not measured.
    """

    pitch: FloatArray  # (turns,) m
    turn: FloatArray | None = None  # (turns,)
    position: FloatArray | None = None  # (turns,) m
    uncertainty: FloatArray | None = None  # (turns,) m, standard
    start_angle: float | None = None  # rad
    flank: str = ""
    source: str = ""


@dataclass(frozen=True, eq=False)
class Pair:
    """The same turns of both tables."""

    turns: FloatArray  # (turns,) number in the nominal table
    nominal: FloatArray  # (turns,) m
    measured: FloatArray  # (turns,) m
    uncertainty: FloatArray  # (turns,) m
    offset: float  # turn of the nominal table less that of the measured one
    nominal_uncertainty: FloatArray  # (turns,) m, of each nominal pitch, where its crossings are uncertain; else 0
    target: FloatArray  # (turns,) m, P_ref

    def part(self, number: int, count: int) -> NDArray[np.bool_]:
        """(turns,) which of them are in the ``number``-th, from 0, of ``count`` equal stretches."""
        return np.asarray(np.arange(self.turns.size) * count // self.turns.size == number)

    def only(self, kept: NDArray[np.bool_]) -> Pair:
        """Some of the turns."""
        return Pair(self.turns[kept], self.nominal[kept], self.measured[kept], self.uncertainty[kept], self.offset,
                    self.nominal_uncertainty[kept], self.target[kept])


@dataclass(frozen=True, eq=False)
class NominalThread:
    """Nominal pitches of one start angle, and what is known of them."""

    pitch: FloatArray  # (turns,) m
    target: FloatArray  # (turns,) m, P_ref
    places: FloatArray | None = None  # (turns,) m, middle of each turn along the axis
    uncertainty: FloatArray | None = None  # (turns,) m, standard, of its crossings


def pitches(values: ArrayLike, name: str) -> FloatArray:
    """(turns,) m; NaN where a turn is missing.

    Raises:
        JudgementError: no numbers, not one row of them, infinite or no pitch in metres.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise JudgementError(f"{name} pitches are no array of numbers; give (turns,) in m, NaN where one is missing") \
            from None
    if array.ndim != 1:
        raise JudgementError(f"{name} pitches have the shape {array.shape}; give one value per turn, (turns,)")
    bad = np.isinf(array) | (np.abs(array) > LARGEST)
    if bad.any():
        turn = int(np.argmax(bad)) + 1
        raise JudgementError(f"{name} pitch of turn {turn} is {array[turn - 1]:g} m; give pitches in m, NaN where one "
                             "is missing")
    return array


def pairs(nominal: NominalThread, measured: MeasuredThread, uncertainty: FloatArray) -> list[Pair]:
    """The ways to lay the measured turns over the nominal ones; one where turn numbers or positions say it.

    Raises:
        JudgementError: turn numbers are no whole numbers or come twice, positions lie between the turns.
    """
    if measured.turn is not None:
        numbers = _whole(measured.turn, "turn")
        return [_pair(nominal, measured, uncertainty, numbers, 0.0)]
    if measured.position is not None and nominal.places is not None:
        numbers = _by_place(measured.position, nominal.places)
        return [_pair(nominal, measured, uncertainty, numbers, float(numbers[0] - 1.0))]
    counted = np.arange(1.0, measured.pitch.size + 1.0)
    spare = nominal.pitch.size - measured.pitch.size
    return [_pair(nominal, measured, uncertainty, counted + offset, float(offset))
            for offset in range(min(spare, 0), max(spare, 0) + 1)]


def nominal_row(table: PitchTable, row: int, target: FloatArray) -> NominalThread:
    """One start angle of a table; without places where the table has no crossings."""
    crossings = table.crossings[row]
    places = None if np.isnan(crossings).all() else 0.5 * (crossings[1:] + crossings[:-1])
    uncertainty = None if table.uncertainty is None else table.uncertainty[row]
    return NominalThread(table.pitch[row], target, places, uncertainty)


def nearest_row(table: PitchTable, start_angle: float) -> int:
    """The row of the table for this start angle.

    Raises:
        JudgementError: no row lies within a degree of it.
    """
    apart = np.abs((table.start_angles - start_angle + 0.5 * TURN) % TURN - 0.5 * TURN)
    row = int(np.argmin(apart))
    if apart[row] > TURN / 360.0:
        raise JudgementError(f"measured at the start angle {start_angle / TURN * 360.0:.6g} degrees, for which there "
                             "are no nominal pitches; calculate them with --start-angle")
    return row


def _pair(nominal: NominalThread, measured: MeasuredThread, uncertainty: FloatArray, numbers: FloatArray,
          offset: float) -> Pair:
    order = np.argsort(numbers)
    order = order[(numbers[order] >= 1.0) & (numbers[order] <= nominal.pitch.size)]
    inside = numbers[order]
    rows = inside.astype(np.int64) - 1
    seen = nominal.pitch[rows]
    doubt = np.zeros(seen.size) if nominal.uncertainty is None else np.nan_to_num(nominal.uncertainty[rows])
    both = Pair(inside, seen, measured.pitch[order], uncertainty[order], offset, doubt,
                nominal.target[rows])
    return both.only(~np.isnan(seen) & ~np.isnan(both.measured) & ~np.isnan(both.target))


def _whole(numbers: FloatArray, name: str) -> FloatArray:
    rounded = np.round(numbers)
    if not np.isfinite(numbers).all() or (np.abs(numbers - rounded) > 1e-6).any():
        bad = numbers[~(np.abs(numbers - rounded) <= 1e-6)][0]
        raise JudgementError(f"measured {name} {bad:g} is no whole number; number the turns 1, 2, 3, ...")
    values, counts = np.unique(rounded, return_counts=True)
    if (counts > 1).any():
        raise JudgementError(f"measured {name} {values[counts > 1][0]:g} comes {counts.max()} times; give each turn "
                             "once, and flanks and start angles apart")
    return rounded


def _by_place(position: FloatArray, places: FloatArray) -> FloatArray:
    """(measured,) turn numbers of the nearest nominal turns; beyond their ends counted on in whole leads."""
    known = np.flatnonzero(~np.isnan(places))
    if known.size < 2:
        raise JudgementError("the nominal table has no two turns with positions; give turn numbers")
    exact = _turn_at(position, places[known], np.asarray(known + 1.0, dtype=np.float64))
    turns = np.round(exact)
    astray = np.abs(exact - turns)
    if not np.isfinite(exact).all() or float(np.median(astray)) > _ASTRAY:
        raise JudgementError(f"measured positions lie {np.median(astray):.2f} of a lead from the middle of the nominal "
                             "turns; measure from the zero of the feed's position, or give turn numbers")
    return _whole(turns, "turn (by its position)")


def _turn_at(position: FloatArray, places: FloatArray, numbers: FloatArray) -> FloatArray:
    """(measured,) turn, not whole, at a place; between two turns on a line, beyond them with the lead at that end."""
    sense = 1.0 if places[-1] > places[0] else -1.0
    along, at = sense * places, sense * position
    first, last = np.diff(along[:2]) / np.diff(numbers[:2]), np.diff(along[-2:]) / np.diff(numbers[-2:])
    inside = np.interp(at, along, numbers)
    return np.asarray(inside + np.minimum(at - along[0], 0.0) / first + np.maximum(at - along[-1], 0.0) / last)
