"""What a run leaves behind: ``Recorder`` fills rows while it runs, ``Result`` gives them out by name."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.description import FmuVariable
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.instance import DTYPES, KINDS, Values
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import nearest

Column: TypeAlias = NDArray[Any]  # (rows,) float64, int32 or bool
_BLOCK = 4096  # rows of a CSV that are written at once


@dataclass(frozen=True)
class Channel:
    """One recorded variable."""

    component: str
    variable: FmuVariable

    @property
    def name(self) -> str:
        """``component.variable``."""
        return f"{self.component}.{self.variable.name}"


class Recorder:
    """Rows of values at the communication points, in arrays that are allocated once.

    ``rows[kind]`` has the shape (steps + 1, channels of this kind); row n belongs to ``start + n * step_size``, row 0
    to the values after initialisation. ``filled`` counts the rows that are valid.

    Raises (the class itself):
        CosimError: the rows do not fit into the memory.
    """

    def __init__(self, channels: Sequence[Channel], schedule: Schedule) -> None:
        self.schedule = schedule
        self.channels = {kind: tuple(channel for channel in channels if channel.variable.kind == kind)
                         for kind in KINDS}
        count = schedule.steps + 1
        try:
            self.rows: dict[str, Values] = {
                kind: np.empty((count, len(found)), DTYPES[kind]) for kind, found in self.channels.items()}
        except (MemoryError, ValueError):
            raise CosimError(f"{count} rows of {len(channels)} variables do not fit into the memory; record fewer "
                             "variables or take a larger step") from None
        self.filled = 0


class Result(Mapping[str, Column]):
    """The recorded variables of a run by ``component.variable``, each (rows,); ``time`` (rows,) in seconds.

    The rows are the communication points ``start + n * step_size``: n = 0 after initialisation, then after every step.
    Real variables are float64, Integers and Enumerations int32, Booleans bool; units are those of the FMUs. A run
    that was stopped holds the rows up to then; ``completed`` tells.
    """

    def __init__(self, recorder: Recorder, *, wall_time: float = 0.0, order: Sequence[str] = (),
                 warnings: Sequence[str] = ()) -> None:
        self.schedule = recorder.schedule
        self.steps = max(recorder.filled - 1, 0)
        self.completed = recorder.filled == recorder.schedule.steps + 1
        self.wall_time = wall_time  # s
        self.order = tuple(order)
        self.warnings = tuple(warnings)
        self.time: NDArray[np.float64] = recorder.schedule.times(recorder.filled)
        self.units: dict[str, str | None] = {}
        self._columns: dict[str, tuple[Values, int, bool]] = {}
        for kind, channels in recorder.channels.items():
            for number, channel in enumerate(channels):
                self.units[channel.name] = channel.variable.unit
                self._columns[channel.name] = (recorder.rows[kind][:recorder.filled], number, kind == "Boolean")

    def __getitem__(self, name: str) -> Column:
        if name == "time":
            return self.time
        if name not in self._columns:
            raise KeyError(f"{name} was not recorded{nearest(name, self._columns)}")
        rows, number, truth = self._columns[name]
        column = rows[:, number]
        return column != 0 if truth else column

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        state = "" if self.completed else ", stopped early"
        return f"<Result: {len(self)} variables, {len(self.time)} rows{state}>"

    def save(self, folder: str | Path) -> Path:
        """Write ``trace.csv`` into a folder (made if need be) and return its path.

        The header names variable and unit: ``time [s]``, ``spindle.speed [rad/s]``. Numbers are written so that
        reading gives the same bits, Booleans as 0 and 1. The file appears whole or not at all.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        target = folder / "trace.csv"
        descriptor, temporary = tempfile.mkstemp(prefix=".trace-", suffix=".csv", dir=folder)
        try:
            with os.fdopen(descriptor, "w", encoding="utf-8", newline="") as file:
                file.write(self._header())
                for first in range(0, len(self.time), _BLOCK):
                    file.write(self._block(slice(first, first + _BLOCK)))
            Path(temporary).chmod(0o644)  # mkstemp makes files that only their owner can read
            os.replace(temporary, target)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
        return target

    def _header(self) -> str:
        text = io.StringIO()
        names = [f"{name} [{self.units[name]}]" if self.units[name] else name for name in self]
        csv.writer(text, lineterminator="\n").writerow(["time [s]", *names])
        return text.getvalue()

    def _block(self, rows: slice) -> str:
        """The lines of some rows: whole columns become text at once, which is several times faster than row by row."""
        columns = [map(repr, self.time[rows].tolist())]
        for values, number, _ in self._columns.values():
            columns.append(map(repr, values[rows, number].tolist()))
        return "".join(",".join(line) + "\n" for line in zip(*columns, strict=True))
