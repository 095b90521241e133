"""Angle and position of the passes of a run, out of what it recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.report.columns import read_columns
from threadpitch.report.content import ReportError, Samples
from threadpitch.report.pitch_file import CalculatedPass
from threadpitch.trace import TURN, FloatArray

SPEED, FOLLOWING_ERROR = "spindle.speed", "z_drive.following_error"
_NEAR = 1e-9  # turns: a start angle that is that of the edge itself
# What the calculators of the lathe are connected with, for a run that does not tell.
_DEFAULT_SOURCES = {
    "nominal_pitch.spindle_angle": "spindle.encoder_angle", "nominal_pitch.feed_position": "z_drive.measured_position",
    "actual_pitch.spindle_angle": "spindle.angle", "actual_pitch.feed_position": "cutting.groove_position",
}


@dataclass(frozen=True)
class _Source:
    """An output, and how its values become those of the input that it is connected with."""

    name: str
    factor: float = 1.0
    offset: float = 0.0


class Recording:
    """The recorded columns that a calculator of a run had as inputs; notes where they are missing."""

    def __init__(self, path: Path, metadata: Mapping[str, Any], passes: Sequence[CalculatedPass]) -> None:
        self._order = [one.number for one in passes]
        self._columns: dict[str, FloatArray] = {}
        self._note = ""
        calculator = passes[0].calculator
        self._sources = {target: _source(metadata, calculator, target) for target in ("spindle_angle", "feed_position")}
        self._threading, self._start = f"{calculator}.threading", f"{calculator}.threading_start"
        needed = [*(source.name for source in self._sources.values()), self._threading, self._start]
        try:
            self._columns = read_columns(path, [*needed, SPEED, FOLLOWING_ERROR])
        except ReportError as error:
            self._note = f"{error}"
        except OSError as error:
            self._note = f"No recording: {path}: {(error.strerror or f'{error}').lower()}"
        missing = [name for name in needed if name not in self._columns]
        if missing and not self._note:
            self._note = f"No recording: {path} does not hold {', '.join(missing)}"

    def samples(self, one: CalculatedPass) -> tuple[Samples | None, tuple[str, ...]]:
        """The rows of a pass, from its first crossing of the first start angle on."""
        if self._note:
            return None, (self._note,)
        cuts = [cut for cut in self._cuts() if cut.stop - cut.start > 2 and self._turn(cut, one)[-1] >= 1.0]
        if len(cuts) != len(self._order):
            return None, (f"No recording: {len(cuts)} passes in it, {len(self._order)} in the pitch table",)
        rows = cuts[self._order.index(one.number)]
        turn = self._turn(rows, one)
        position = self._of("feed_position", rows)
        position = position - np.interp(0.0, turn, position)
        error = self._columns.get(FOLLOWING_ERROR)
        sense = -1.0 if position[-1] < 0.0 else 1.0
        speed = self._columns.get(SPEED)
        return Samples(turn, sense * position, None if speed is None else speed[rows],
                       None if error is None else sense * error[rows]), ()

    def _cuts(self) -> list[slice]:
        """Rows of every stretch of threading, with one row before and one after."""
        threading = self._columns[self._threading] > 0.5
        edges = np.diff(np.concatenate(([0], threading.astype(np.int8), [0])))
        return [slice(max(int(begin) - 1, 0), int(end) + 1) for begin, end
                in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)]

    def _turn(self, rows: slice, one: CalculatedPass) -> FloatArray:
        """(rows,) revolutions from where n = 1 of the first start angle begins."""
        turn = np.maximum.accumulate(self._of("spindle_angle", rows)) / TURN
        begin = float(self._columns[self._start][rows][-2]) / TURN  # that of this pass: the row before may not have it
        start = float(one.table.start_angles[0]) / TURN
        return np.asarray(turn - (start + np.ceil(begin - start - _NEAR)))

    def _of(self, target: str, rows: slice) -> FloatArray:
        source = self._sources[target]
        return np.asarray(self._columns[source.name][rows] * source.factor + source.offset)


def _source(metadata: Mapping[str, Any], calculator: str, target: str) -> _Source:
    """What an input of a calculator is connected with."""
    wanted = f"{calculator}.{target}"
    for link in metadata.get("connections", []):
        if isinstance(link, list) and len(link) == 4 and link[1] == wanted:
            return _Source(str(link[0]), float(link[2]), float(link[3]))
    return _Source(_DEFAULT_SOURCES.get(wanted, wanted))
