"""Crossings by edges of whole recordings, and of such as come piece by piece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from threadpitch.pitch.edges import MOST, NUMBERS, WINDOW, Counts, Window, crossing_in, variances_of
from threadpitch.pitch.recorded import pitch_table
from threadpitch.pitch.rounding import LOOKED_AT
from threadpitch.pitch.table import PitchError, PitchTable
from threadpitch.trace import TURN, FloatArray, Trace


def edge_pitch_table(trace: Trace, start_angles: ArrayLike | None = (0.0,)) -> PitchTable:
    """``pitch_table`` with crossings by the edges, and with ``PitchTable.uncertainty``.

    A crossing that has fewer than ``LEAST`` observations around it, or on one side only, is NaN.

    Raises:
        PitchError: as ``pitch_table``; there are too few observations for a single turn.
    """
    linear = pitch_table(trace, start_angles)
    edges = EdgeStream(linear.start_angles, linear.turns_before, trace.resolution, trace.whole())
    edges.add(trace.angle, trace.position)
    return edges.table(linear)


class EdgeStream:
    """Crossings by edges of a recording that comes piece by piece: the same bits, however it is cut.

        edges = EdgeStream(start_angles, turns_before, resolution)
        for angle, position in pieces:
            edges.add(angle, position)
        table = edges.table(linear)

    Memory grows with the turns: of the samples those around the next crossing are kept.

    Args:
        start_angles: (start_angles,) rad, and ``turns_before`` of the table of linear crossings.
        resolution: one count of the angle, rad; 0 = to be found.
        label: what to call the recording in a message.
    """

    def __init__(self, start_angles: FloatArray, turns_before: int, resolution: float, label: str) -> None:
        self._starts, self._before, self._resolution, self._label = start_angles, turns_before, resolution, label
        self._counts: Counts | None = None  # once there are enough samples to find them
        self._next = np.zeros(start_angles.size, np.int64)  # columns
        self._window = Window(*(np.empty(0) for _ in range(3)))
        self._places: list[tuple[int, int]] = []  # start angle and column of the rows
        self._rows = np.empty((0, NUMBERS))

    def add(self, angle: FloatArray, position: FloatArray) -> None:
        """The next samples, angle (samples,) rad, position (samples,) m, without faults."""
        self._window = self._window.longer(angle, position)
        if self._counts is None:
            if self._window.angle.size < LOOKED_AT:
                return
            self._counts = self._find_counts()
        for start in range(self._starts.size):
            while self._is_whole(level := self._level(start, int(self._next[start]))):
                self._cross(start, level)
        reached = min(self._window.reaching(self._level(start, int(column)))
                      for start, column in enumerate(self._next))
        self._window = self._window.since(reached - MOST)

    def table(self, linear: PitchTable) -> PitchTable:
        """The table of linear crossings with those by edges in their place, and ``PitchTable.uncertainty``.

        Raises:
            PitchError: there are too few observations for a single turn.
        """
        counts = self._counts = self._counts or self._find_counts()
        columns = linear.crossings.shape[1]
        for start in range(self._starts.size):
            while self._next[start] < columns:
                self._cross(start, self._level(start, int(self._next[start])))
        crossings, variances = np.full(linear.crossings.shape, np.nan), np.full(linear.crossings.shape, np.nan)
        places = np.array(self._places, np.int64).reshape(-1, 2)
        known = ~np.isnan(linear.crossings[places[:, 0], places[:, 1]])
        order = np.lexsort((places[:, 1], places[:, 0]))
        order = order[known[order]]
        rows, at = self._rows[order], tuple(places[order].T)
        crossings[at] = rows[:, 0]
        if np.isnan(np.diff(crossings, axis=1)).all():
            raise PitchError(f"{self._label}: too few samples or counts per turn for crossings by edges; take linear "
                             "ones")
        variances[at] = variances_of(rows, counts)
        direction = np.sign(np.nansum(linear.pitch * np.diff(linear.crossings, axis=1))) or 1.0
        note = "crossings by the edges of the angle's counts, with the standard uncertainty of every P(n)"
        return replace(
            linear,
            pitch=direction * np.diff(crossings, axis=1) + 0.0,
            crossings=crossings,
            extrapolated=np.zeros_like(linear.extrapolated),
            uncertainty=np.sqrt(variances[:, 1:] + variances[:, :-1]),
            notes=(*linear.notes, note),
        )

    def _find_counts(self) -> Counts:
        return Counts.of(self._window.angle, self._window.position, self._resolution)

    def _level(self, start: int, column: int) -> float:
        return float(self._starts[start] + TURN * (self._before + column))

    def _is_whole(self, level: float) -> bool:
        """Whether all samples have come that a crossing is found by."""
        window = self._window
        return window.reaching(level + WINDOW) < window.angle.size or (
            window.reaching(level) + MOST <= window.angle.size)

    def _cross(self, start: int, level: float) -> None:
        assert self._counts is not None
        found = crossing_in(self._window, level, self._counts)
        if found is not None:
            count = len(self._places)
            if count == self._rows.shape[0]:
                self._rows = np.concatenate((self._rows, np.empty((max(count, 16), NUMBERS))))
            self._rows[count] = found.row()
            self._places.append((start, int(self._next[start])))
        self._next[start] += 1
