"""Logs whose columns come as arrays, chunk by chunk: Parquet, HDF5, MAT, TDMS, MDF, SINUMERIK."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.trace.choice import Chosen, ColumnChoice, brief, choose
from threadpitch.trace.passes import Array, Cutter, Piece
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray


@dataclass(frozen=True, eq=False)
class Chunk:
    """Neighbouring rows of a log."""

    columns: list[Array]  # those that were asked for, (rows,) each
    share: float = 1.0  # of the log that is read with them, 0 to 1


Chunks = Callable[[Sequence[int]], Generator[Chunk]]  # the columns asked for, chunk by chunk


@dataclass(frozen=True)
class Columns:
    """What an array log offers: names, units, how it is read, and what is to be known about that."""

    names: Sequence[str]
    units: Sequence[str]
    chunks: Chunks
    ends_with_time: bool = False  # the last column is the time of the angle
    usual_angle: str = ""  # unit of an angle that has none, where the format tells it
    notes: Callable[[Chosen], tuple[str, ...]] = lambda _: ()


class ArrayLog:
    """A log of named columns; those that are chosen are read, and no others.

    Raises (the class itself, and while the pieces are read):
        TraceError: a column is not there or holds no numbers, no threading row, the file is damaged.
    """

    def __init__(self, source: str, columns: Columns, choice: ColumnChoice) -> None:
        if not columns.names:
            raise TraceError(f"{source}: there is no column of numbers")
        self.source = source
        chosen = choose(source, columns.names, choice, columns.units, columns.usual_angle)
        if columns.ends_with_time and len(columns.names) - 1 in (chosen.angle, chosen.position):
            raise TraceError(f"{source}: the time is neither angle nor position; choose other columns")
        self.chosen = replace(chosen, notes=(*chosen.notes, *columns.notes(chosen)))
        self._names = list(columns.names)
        self._chunks = columns.chunks
        self._open: Generator[Chunk] | None = None
        self.share: float | None = None

    def close(self) -> None:
        """Close the file."""
        if self._open is not None:
            self._open.close()

    def pieces(self) -> Iterator[Piece]:
        """The threading rows, as long as they have one label and lie in one chunk."""
        wanted = self.chosen.columns
        cutter = Cutter(self.source, self.chosen, self._names)
        rows = 0
        self._open = self._chunks(wanted)
        for chunk in self._open:
            self.share = chunk.share
            columns = dict(zip(wanted, chunk.columns, strict=True))
            first = columns[self.chosen.angle]
            if any(array.shape != first.shape or array.ndim != 1 for array in chunk.columns):
                raise TraceError(f"{self.source}: {lengths_differ(self._names, columns)}")
            groups = None if self.chosen.group is None else columns[self.chosen.group]
            yield from cutter.pieces(first.size, groups, self._reader(columns))
            rows += first.size
        if rows == 0:
            raise TraceError(f"{self.source}: there are no rows")
        cutter.end()

    def _reader(self, columns: dict[int, Array]) -> Callable[[int, slice], FloatArray]:
        def numbers(column: int, part: slice) -> FloatArray:
            values = columns[column][part]
            if column == self.chosen.time and values.dtype.kind == "M":  # a time of day counts from its year 1970
                since: FloatArray = values.astype("datetime64[ns]").astype(np.int64) / (1e9 * self.chosen.time_factor)
                return since
            if values.dtype.kind not in "fiub":
                raise TraceError(f"{self.source}: column {brief(self._names[column])} holds {values.dtype}, not "
                                 "numbers; choose another column")
            return np.ascontiguousarray(values, dtype=np.float64)

        return numbers


def lengths_differ(names: Sequence[str], columns: dict[int, Array]) -> str:
    """That the columns differ in length, and how to mend it."""
    lengths = ", ".join(f"{brief(names[column])} {array.shape}" for column, array in columns.items())
    return f"the columns differ in length: {lengths}"
