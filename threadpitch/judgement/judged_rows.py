"""The rows that are judged: nominal and measured pitches of one start angle or flank, and what was wanted of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.judgement.alignment import MeasuredThread, NominalThread, nearest_row, nominal_row, pitches
from threadpitch.judgement.verdict import JudgementError
from threadpitch.pitch import PitchTable
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

_ANOTHER_THREAD = 0.01  # of the target: so far off its middle no control is that cuts this thread
_LINE = 3  # turns through which a straight line tells something
_AGREE = 0.2  # of what they are off the target


def targets_of(target: ArrayLike) -> FloatArray:
    """(1 or start_angles, 1 or revolutions) m."""
    targets = _two_dimensional(target, "target")
    if not np.isfinite(targets).any():
        raise JudgementError("the target is no number; give the movement per revolution (the lead) in m")
    return targets


def _of_turns(targets: FloatArray, row: int, turns: int) -> FloatArray:
    """(turns,) m, of one row of the nominal pitches."""
    of_row = targets[min(row, len(targets) - 1)]
    if of_row.size not in (1, turns):
        raise JudgementError(f"{of_row.size} targets and {turns} nominal turns; give one for each turn, or one for all")
    return np.asarray(np.broadcast_to(of_row, turns))


@dataclass(frozen=True, eq=False)
class Row:
    """What is compared."""

    nominal: NominalThread
    measured: MeasuredThread


def doubts(row: Row, lead: float) -> tuple[str, ...]:
    """Pitches that agree with each other and not with the target: another thread was cut than the one it is of.

    Those of another thread are all of one lead, or change evenly; a control that is off by so much is not so steady.
    """
    middle = float(np.nanmedian(row.nominal.pitch))
    off = float(np.nanmedian(row.nominal.pitch - row.nominal.target))
    apart = abs(float(np.nanmedian(row.measured.pitch)) - middle)
    if abs(off) < _ANOTHER_THREAD * lead or apart > _AGREE * abs(off) or _unsteady(row.nominal) > _AGREE * abs(off):
        return ()
    return (f"nominal and measured pitches agree on {from_si(middle, 'mm'):.5g} mm and the target is "
            f"{from_si(middle - off, 'mm'):.5g} mm: is it that of this thread, and of every turn of it?",)


def _unsteady(nominal: NominalThread) -> float:
    """m, root mean square of the deviation from the target about a straight line over the turns."""
    deviation = nominal.pitch - nominal.target
    known = np.flatnonzero(np.isfinite(deviation))
    if known.size < _LINE:
        return 0.0
    line = np.polynomial.Polynomial.fit(known, deviation[known], 1)
    return float(np.sqrt(np.mean((deviation[known] - line(known)) ** 2)))


def rows_of(nominal: ArrayLike | PitchTable, measured: ArrayLike | MeasuredThread | Sequence[MeasuredThread],
          targets: FloatArray) -> list[Row]:
    """One for each start angle or flank that was measured.

    Raises:
        JudgementError: no numbers, other numbers of rows, targets or turns.
    """
    if isinstance(measured, MeasuredThread):
        measured = [measured]
    if isinstance(measured, Sequence) and measured and isinstance(measured[0], MeasuredThread):
        return [_row_of(nominal, one, targets) for one in measured if isinstance(one, MeasuredThread)]
    table = _two_dimensional(measured, "measured")
    if isinstance(nominal, PitchTable):
        seen = [replace(_of_table(nominal, row, targets), places=None) for row in range(len(nominal.pitch))]
    else:
        seen = [_of_array(nominal, row, targets) for row in range(len(_two_dimensional(nominal, "nominal")))]
    if len(table) == 1:
        seen = seen[:1]
    if len(seen) != len(table):
        raise JudgementError(f"{len(table)} rows of measured pitches, {len(seen)} of nominal ones; give one row for "
                             "each start angle")
    return [Row(one, MeasuredThread(pitches(other, "measured"))) for one, other in zip(seen, table, strict=True)]


def _row_of(nominal: ArrayLike | PitchTable, measured: MeasuredThread, targets: FloatArray) -> Row:
    if not isinstance(nominal, PitchTable):
        return Row(_of_array(nominal, 0, targets), measured)
    row = 0 if measured.start_angle is None else nearest_row(nominal, measured.start_angle)
    return Row(_of_table(nominal, row, targets), measured)


def _of_table(nominal: PitchTable, row: int, targets: FloatArray) -> NominalThread:
    return nominal_row(nominal, row, _of_turns(targets, row, nominal.pitch.shape[1]))


def _of_array(nominal: ArrayLike, row: int, targets: FloatArray) -> NominalThread:
    pitch = pitches(_two_dimensional(nominal, "nominal")[row], "nominal")
    return NominalThread(pitch, _of_turns(targets, row, pitch.size))


def _two_dimensional(values: object, name: str) -> FloatArray:
    try:
        array = np.atleast_2d(np.ma.filled(np.ma.array(values, dtype=np.float64), np.nan))  # masked is missing
    except (TypeError, ValueError):
        raise JudgementError(f"{name} pitches are no array of numbers; give (turns,) in m, NaN where one is missing") \
            from None
    if array.ndim != 2:
        raise JudgementError(f"{name} pitches have the shape {array.shape}; give (turns,) or (start_angles, turns)")
    return array
