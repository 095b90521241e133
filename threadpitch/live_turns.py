"""Revolutions while a simulation runs: the rows in which a pitch calculator ends a turn -> P(n)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.passes import TURNS_A_STEP, Columns


@dataclass(frozen=True)
class LiveTurn:
    """A revolution that has just been completed."""

    calculator: str
    number_of_pass: int
    turn: int  # n
    start_angle: float  # rad
    pitch: float  # m
    target: float  # m


class LiveTurns:
    """Finds the turns in rows that come piece by piece, in the order of their ends."""

    def __init__(self, calculators: Sequence[str], turned: Callable[[list[LiveTurn]], None]) -> None:
        self._calculators, self._turned = calculators, turned
        self._passes = dict.fromkeys(calculators, 0)
        self._threading = dict.fromkeys(calculators, False)  # in the last row

    def __call__(self, columns: Columns) -> None:
        """The next rows."""
        found: list[tuple[int, LiveTurn]] = []  # row
        for name in self._calculators:
            threading = np.asarray(columns[f"{name}.threading"], dtype=np.bool_)
            rises = threading & ~np.concatenate(([self._threading[name]], threading[:-1]))
            numbers = self._passes[name] + np.cumsum(rises)  # (rows,)
            for angle in range(int(columns[f"{name}.start_angle_count"][0])):
                found += _turns(columns, name, angle, numbers)
            self._passes[name], self._threading[name] = int(numbers[-1]), bool(threading[-1])
        if found:
            self._turned([turn for _, turn in sorted(found, key=lambda one: one[0])])


def _turns(columns: Columns, name: str, angle: int, numbers: NDArray[np.int64]) -> list[tuple[int, LiveTurn]]:
    """Turns of one start angle with their rows; several may end in one."""
    completed = columns[f"{name}.completed[{angle + 1}]"]
    revolution = columns[f"{name}.revolution[{angle + 1}]"]
    start = float(columns[f"{name}.start_angle[{angle + 1}]"][0])
    target = float(columns[f"{name}.pitch_target"][0])
    found = []
    for row in np.flatnonzero(completed).tolist():
        count = int(completed[row])
        for place in range(count):
            pitch = float(columns[f"{name}.completed_pitch[{TURNS_A_STEP * angle + place + 1}]"][row])
            turn = int(revolution[row]) - count + place + 1
            found.append((row, LiveTurn(name, int(numbers[row]), turn, start, pitch, target)))
    return found
