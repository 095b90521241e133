"""Logs whose columns come as arrays, chunk by chunk: Parquet, HDF5, MAT, TDMS, MDF."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.trace.choice import ColumnChoice, brief, choose
from threadpitch.trace.groups import Labels, Piece
from threadpitch.trace.recording import IntArray, TraceError
from threadpitch.trace.soundness import FloatArray

Array = NDArray[Any]
Chunks = Callable[[Sequence[int]], Generator[list[Array]]]  # the columns asked for, (rows,) each, chunk by chunk


class ArrayLog:
    """A log of named columns; ``chunks`` reads those that are chosen, and no others.

    Raises (the class itself, and while the pieces are read):
        TraceError: a column is not there or holds no numbers, no threading row, the file is damaged.
    """

    def __init__(self, source: str, names: Sequence[str], units: Sequence[str], chunks: Chunks,
                 choice: ColumnChoice) -> None:
        if not names:
            raise TraceError(f"{source}: there is no column of numbers")
        self.source = source
        self.chosen = choose(source, names, choice, units)
        self._names = names
        self._chunks = chunks
        self._labels = Labels()
        self._label = ""  # of the row before
        self._open: Generator[list[Array]] | None = None

    def close(self) -> None:
        """Close the file."""
        if self._open is not None:
            self._open.close()

    def pieces(self) -> Iterator[Piece]:
        """The threading rows, as long as they have one label and lie in one chunk."""
        chosen = self.chosen
        wanted = list(dict.fromkeys(i for i in (chosen.angle, chosen.position, chosen.time, chosen.group)
                                    if i is not None))
        rows, threading = 0, False
        for arrays in (chunks := self._chunks(wanted)):
            self._open = chunks
            columns = dict(zip(wanted, arrays, strict=True))
            first = columns[chosen.angle]
            if any(array.shape != first.shape or array.ndim != 1 for array in arrays):
                lengths = ", ".join(f"{brief(self._names[i])} {columns[i].shape}" for i in wanted)
                raise TraceError(f"{self.source}: the columns differ in length: {lengths}")
            for piece in self._of_chunk(columns, rows):
                threading = True
                yield piece
            rows += first.size
        if rows == 0:
            raise TraceError(f"{self.source}: there are no rows")
        if not threading:
            name = brief(self._names[chosen.group]) if chosen.group is not None else ""
            raise TraceError(f"{self.source}: no row is threading: column {name} is 0, empty or false everywhere; "
                             "choose another group column or none")

    def _of_chunk(self, columns: dict[int, Array], above: int) -> Iterator[Piece]:
        chosen = self.chosen
        borders, labels = self._runs(columns.get(-1 if chosen.group is None else chosen.group),
                                     columns[chosen.angle].size)
        for first, last, label in zip(borders[:-1], borders[1:], labels, strict=True):
            if label:
                part = slice(int(first), int(last))
                time = None if chosen.time is None else self._seconds(columns[chosen.time][part], chosen.time)
                yield Piece(label, label != self._label, self._numbers(columns[chosen.angle][part], chosen.angle),
                            self._numbers(columns[chosen.position][part], chosen.position), time)
            self._label = label

    def _runs(self, values: Array | None, size: int) -> tuple[IntArray, list[str]]:
        """(runs + 1,) borders of the runs of one group value, and the label of each."""
        if size == 0:
            return np.zeros(1, np.int64), []
        if values is None:
            return np.array([0, size]), ["1"]
        changes = np.flatnonzero(values[1:] != values[:-1]) + 1
        borders = np.concatenate(([0], changes, [size]))
        return borders, [self._labels[_text(values[i])] for i in borders[:-1]]

    def _seconds(self, values: Array, column: int) -> FloatArray:
        """A time of day counts from its year 1970."""
        if values.dtype.kind == "M":
            seconds: FloatArray = values.astype("datetime64[ns]").astype(np.int64) / (1e9 * self.chosen.time_factor)
            return seconds
        return self._numbers(values, column)

    def _numbers(self, values: Array, column: int) -> FloatArray:
        if values.dtype.kind not in "fiub":
            raise TraceError(f"{self.source}: column {brief(self._names[column])} holds {values.dtype}, not numbers; "
                             "choose another column")
        return np.ascontiguousarray(values, dtype=np.float64)


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return str(value)
