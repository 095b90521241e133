"""xi(theta) stored at intervals of the angle, as a controller does that has no memory for every sample.

    xi_k = xi(k delta),     P(n) = xi(theta_S + 360 n) - xi(theta_S + 360 (n - 1))

out of the stored values: exactly that of all samples where theta_S and 360 degrees lie on the grid of delta, else
interpolated between its points. Source: US 2016/0008901 A1, paragraph 0035 (10 degrees).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.pitch.stream import PitchStream
from threadpitch.pitch.table import PitchError, PitchTable
from threadpitch.trace import TURN, FloatArray

SMALLEST = math.radians(0.01)
LARGEST = TURN
_ROUNDING = 1e-9  # rad, of a point of the grid


@dataclass(frozen=True, eq=False)
class Stored:
    """Positions at the multiples of an interval that the recording has reached."""

    interval: float  # rad
    angle: FloatArray  # (points,) rad
    position: FloatArray  # (points,) m
    passing: bool = False  # a pass of a longer recording: its turns are counted from its first point on

    def pitch_table(self, start_angles: ArrayLike = (0.0,)) -> PitchTable:
        """P(n) out of the stored positions.

        Raises:
            PitchError: less than one whole turn is stored.
        """
        stream = PitchStream(start_angles, margin=_ROUNDING if self.passing else None)
        if self.angle.size:
            stream.add(self.angle, self.position)
        table = stream.final_table()
        note = (f"P(n) out of positions stored every {math.degrees(self.interval):.6g} degrees "
                f"({self.angle.size} of them)")
        return replace(table, notes=(*table.notes, note))


def grid(interval: float) -> tuple[FloatArray, float]:
    """(start angles rad, factor of the angle) with which the crossings of a ``PitchStream`` are the points.

    Raises:
        PitchError: the interval is not between 0.01 degrees and a turn.
    """
    if not SMALLEST <= interval <= LARGEST:
        raise PitchError(f"the sample interval is {math.degrees(interval):g} degrees; give 0.01 to 360")
    count = round(TURN / interval)
    if abs(count * interval - TURN) < 1e-9:
        return np.radians(round(math.degrees(interval), 9) * np.arange(count)), 1.0
    return np.zeros(1), TURN / interval


def stored(table: PitchTable, interval: float) -> Stored:
    """The points out of the crossings of ``grid``'s start angles."""
    starts, factor = grid(interval)
    turns = table.turns_before + np.arange(table.crossings.shape[1])
    angle = ((starts + TURN * turns[:, np.newaxis]) / factor).ravel()  # turn by turn: rising
    position = table.crossings.T.ravel()
    known = ~np.isnan(position)
    return Stored(interval, angle[known], position[known])
