"""``pitch.csv`` of a run folder -> the passes as every calculator saw them."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from threadpitch.pitch import BoolArray, PitchTable
from threadpitch.report.content import ReportError
from threadpitch.run_folder import HEADER
from threadpitch.units import to_si

_LEAST_TARGET = 1e-9  # m
_MOST_TURNS = 10_000_000  # of a pass; a number beyond it is damage


@dataclass(frozen=True, eq=False)
class CalculatedPass:
    """The pitches of one pass as one calculator saw them."""

    calculator: str
    number: int
    start_number: int
    table: PitchTable
    target: float  # m
    in_metal: BoolArray  # (start_angles, revolutions)

    @property
    def chosen(self) -> BoolArray:
        """The turns in the metal, or where there is none, all."""
        known = ~np.isnan(self.table.pitch)
        inside = self.in_metal & known
        return inside if inside.any() else known


@dataclass(frozen=True)
class _Row:
    angle_deg: float
    turn: int
    pitch_mm: float
    deviation_um: float
    in_metal: bool
    start_number: int


def read_pitches(path: Path) -> list[CalculatedPass]:
    """The passes in the order of the file, at least one.

    Raises:
        ReportError: it is not the pitch table of a run, or holds no pitch.
        OSError: the file cannot be read.
    """
    rows: dict[tuple[str, int], list[_Row]] = {}
    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        reader = csv.reader(file)
        if tuple(next(reader, ())) != HEADER:
            raise ReportError(f"{path}:1: is not the pitch table of a run; make it with threadpitch run")
        for fields in reader:
            try:
                calculator, number, start_number, angle, turn, pitch, deviation, in_metal = fields
                row = _Row(float(angle), int(turn), float(pitch), float(deviation), in_metal == "1",
                           int(start_number))
                key = (calculator, int(number))
            except ValueError:
                raise _damaged(path, reader.line_num) from None
            numbers = (row.angle_deg, row.pitch_mm, row.deviation_um)
            if not 1 <= row.turn <= _MOST_TURNS or not all(map(math.isfinite, numbers)):
                raise _damaged(path, reader.line_num)
            rows.setdefault(key, []).append(row)
    if not rows:
        raise ReportError(f"{path}: there is no pitch in it; run longer")
    return [_pass(*key, found) for key, found in rows.items()]


def _damaged(path: Path, line: int) -> ReportError:
    return ReportError(f"{path}:{line}: is no row of the pitch table of a run; make it again with threadpitch run")


def _pass(calculator: str, number: int, rows: list[_Row]) -> CalculatedPass:
    angles = list(dict.fromkeys(row.angle_deg for row in rows))
    shape = (len(angles), max(row.turn for row in rows))
    place = [angles.index(row.angle_deg) for row in rows], [row.turn - 1 for row in rows]
    pitch, in_metal = np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_)
    pitch[place] = [to_si(row.pitch_mm, "mm") for row in rows]
    in_metal[place] = [row.in_metal for row in rows]
    target = to_si(float(np.median([row.pitch_mm - 1e-3 * row.deviation_um for row in rows])), "mm")
    return CalculatedPass(calculator, number, rows[0].start_number,
                          PitchTable.of_pitches(pitch, np.radians(angles)), max(round(target, 12), _LEAST_TARGET),
                          in_metal)
