"""What a run leaves behind: ``Recorder`` fills rows while it runs, ``Result`` gives them out by name."""

from __future__ import annotations

import csv
import io
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.system import nearest
from threadpitch.cosim.variable import FmuVariable

Column: TypeAlias = NDArray[Any]  # (rows,)
WIDTHS = (8, 4, 2, 1)  # bytes of a value
_BLOCK = 4096  # rows of a CSV that are written at once
_FAMILIES = ("Real", "Integer", "Boolean")


@dataclass(frozen=True)
class Channel:
    """One recorded variable."""

    component: str
    variable: FmuVariable

    @property
    def name(self) -> str:
        """``component.variable``."""
        return f"{self.component}.{self.variable.name}"

    @property
    def width(self) -> int:
        """Bytes of a value."""
        return C_TYPES[self.variable.c_type].dtype.itemsize


class Recorder:
    """Rows of values at every n-th communication point, in arrays that are allocated once.

    ``rows[width]`` holds the channels whose values have ``width`` bytes, (rows, channels of this width), as whole
    numbers with the values' bits. Row r belongs to the communication point r * every, row 0 to the values after
    initialisation. ``filled`` counts the rows that are valid, ``steps`` the steps that were computed.

    Raises (the class itself):
        CosimError: the rows do not fit into the memory, or ``every`` is not a positive whole number.
    """

    def __init__(self, channels: Sequence[Channel], schedule: Schedule, every: int = 1) -> None:
        if not isinstance(every, int) or every < 1:
            raise CosimError(f"every {every!r}-th step cannot be recorded; give 1 or more")
        self.schedule = schedule
        self.every = every
        self.channels = tuple(channels)
        self.by_width = {width: tuple(found for found in channels if found.width == width) for width in WIDTHS}
        self.count = schedule.steps // every + 1
        try:
            self.rows = {width: np.empty((self.count, len(found)), f"i{width}")
                         for width, found in self.by_width.items()}
        except (MemoryError, ValueError):
            raise CosimError(f"{self.count} rows of {len(channels)} variables do not fit into the memory; record fewer "
                             "variables, every n-th step only, or take a larger step") from None
        self.filled = 0
        self.steps = 0


class Result(Mapping[str, Column]):
    """The recorded variables of a run by ``component.variable``, each (rows,); ``time`` (rows,) in seconds.

    The rows are the communication points ``start + n * step_size``: n = 0 after initialisation, then after every step,
    or after every n-th where that was asked for. Real variables are float64, Integers and Enumerations of FMI 2.0
    int32, Booleans bool, those of FMI 3.0 have the type of the FMU; units are those of the FMUs. A run that was
    stopped holds the rows up to then; ``completed`` tells.
    """

    def __init__(self, recorder: Recorder, *, wall_time: float = 0.0, order: Sequence[str] = (),
                 warnings: Sequence[str] = ()) -> None:
        self.schedule = recorder.schedule
        self.steps = recorder.steps
        self.completed = recorder.filled == recorder.count and recorder.steps == recorder.schedule.steps
        self.wall_time = wall_time  # s
        self.order = tuple(order)
        self.warnings = tuple(warnings)
        self.time: NDArray[np.float64] = recorder.schedule.times(recorder.filled, recorder.every)
        self.units = {channel.name: channel.variable.unit for channel in _sorted(recorder.channels)}
        self._columns: dict[str, tuple[NDArray[Any], int, bool]] = {}
        places = {channel.name: place for found in recorder.by_width.values() for place, channel in enumerate(found)}
        for channel in _sorted(recorder.channels):
            one = C_TYPES[channel.variable.c_type]
            rows = recorder.rows[channel.width][:recorder.filled].view(one.dtype)
            self._columns[channel.name] = (rows, places[channel.name], one.family == "Boolean")

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
        for values, number, truth in self._columns.values():
            column = values[rows, number]
            columns.append(map(repr, ((column != 0).astype(np.int8) if truth else column).tolist()))
        return "".join(",".join(line) + "\n" for line in zip(*columns, strict=True))


def _sorted(channels: Iterable[Channel]) -> list[Channel]:
    """Real variables first, then whole numbers, then Booleans."""
    return sorted(channels, key=lambda channel: _FAMILIES.index(C_TYPES[channel.variable.c_type].family))
