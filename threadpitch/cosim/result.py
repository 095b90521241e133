"""What a run leaves behind: ``Result`` gives the recorded variables out by name, from memory or from a file."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from threadpitch.cosim.block import Block, Blocks, Channels, Column, Times
from threadpitch.cosim.csv_file import header, lines
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.mat_file import write_mat
from threadpitch.cosim.places import written
from threadpitch.cosim.recording import Columns, Recorder
from threadpitch.cosim.system import nearest


class Result(Mapping[str, Column]):
    """The recorded variables of a run by ``component.variable``, each (rows,); ``time`` (rows,) in seconds.

    The rows are the communication points ``start + n * step_size``: n = 0 after initialisation, then after every step,
    or after those that were asked for. Real variables are float64, Integers and Enumerations of FMI 2.0
    int32, Booleans bool, those of FMI 3.0 have the type of the FMU; ``units`` are those of the FMUs. A run that was
    stopped holds the rows up to then; ``completed`` tells. Of a run that was recorded into a file, columns are read
    when they are asked for; ``path`` is the file. ``metadata`` says how the result was made. ``watched`` are the rows
    that were kept in memory besides, ``events`` what the method waited for, and when it happened.

    A recorder's result is made once, when all is recorded; ``taking`` is the number of the taking that it gives out.
    """

    def __init__(self, recorder: Recorder, *, wall_time: float = 0.0, order: Sequence[str] = (),
                 warnings: Sequence[str] = (), metadata: Mapping[str, Any] | None = None, taking: int = 0) -> None:
        recorder.drain()
        chosen = recorder.takings[taking]
        self.schedule = recorder.schedule
        self.steps = recorder.steps
        self.completed = recorder.completed
        self.events = tuple(recorder.events)
        self.wall_time = wall_time  # s
        self.order = tuple(order)
        self.warnings = tuple(warnings)
        self.metadata = dict(metadata or {})
        self.path: Path | None = None
        self.watched: Result | None = None
        self.rows = chosen.taken
        self._columns: Columns = chosen.sink.close()
        self._layout: Channels = chosen.channels
        self._channels = {channel.name: channel for channel in self._layout.all}
        self.units = {name: channel.variable.unit for name, channel in self._channels.items()}
        self._read: dict[str, Column] = {}  # collecting a column takes its time

    @property
    def time(self) -> Times:
        """Communication points, (rows,) s."""
        return self._columns.times

    def __getitem__(self, name: str) -> Column:
        if name == "time":
            return self.time
        if name not in self._channels:
            raise KeyError(f"{name} was not recorded{nearest(name, self._channels)}")
        if name not in self._read:
            self._read[name] = self._columns.column(self._channels[name])
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._channels)

    def __len__(self) -> int:
        return len(self._channels)

    def __repr__(self) -> str:
        state = "" if self.completed else ", stopped early"
        return f"<Result: {len(self)} variables, {self.rows} rows{state}>"

    def save(self, folder: str | Path) -> Path:
        """Write ``trace.csv`` into a folder (made if need be) and return its path.

        The header names variable and unit: ``time [s]``, ``spindle.speed [rad/s]``. Numbers are written so that
        reading gives the same bits, Booleans as 0 and 1. The file appears whole or not at all.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        return _written_whole(folder / "trace.csv", self._write_csv)

    def save_mat(self, path: str | Path) -> Path:
        """Write a .mat in the layout of Dymola and OpenModelica, which MATLAB reads too, and return its path.

        The file appears whole or not at all.

        Raises:
            CosimError: there is more than a .mat of this version can hold.
        """
        path = Path(path)
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            return _written_whole(path, lambda temporary: write_mat(temporary, self._table(), self.metadata))

    def _write_csv(self, path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="") as file:
            file.write(header(self._layout))
            for block in self._table():
                file.writelines(lines(block))

    def _table(self) -> Block | Blocks:
        """All rows in memory."""
        if isinstance(self._columns, Blocks):
            return self._columns
        rows = self._layout.empty(self.rows)
        try:
            for channel in self._layout.all:
                place = self._layout.places[channel.name]
                bits = self[channel.name].view(f"i{self[channel.name].dtype.itemsize}")
                rows[channel.width][:, place] = bits
        except MemoryError:
            raise CosimError("the recorded rows do not fit into the memory") from None
        return Block.of_rows(self._layout, self.time, rows)


def _written_whole(target: Path, write: Callable[[Path], None]) -> Path:
    """Write a file under another name first, so that it appears complete or not at all."""
    descriptor, temporary = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    os.close(descriptor)
    try:
        write(Path(temporary))
        Path(temporary).chmod(0o644)  # mkstemp makes files that only their owner can read
        os.replace(temporary, target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return target
