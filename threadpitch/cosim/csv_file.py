"""CSV: a table of text that grows while a run computes, with what it says of itself in a JSON file beside it."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim.block import Block, Channel, Channels, Column
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.places import metadata_path, written

_PIECE = 4096  # rows that are text at once


def header(channels: Channels) -> str:
    """The first line: variables with their units, ``time [s],spindle.speed [rad/s]``."""
    text = io.StringIO()
    names = [f"{channel.name} [{channel.variable.unit}]" if channel.variable.unit else channel.name
             for channel in channels.all]
    csv.writer(text, lineterminator="\n").writerow(["time [s]", *names])
    return text.getvalue()


def lines(block: Block) -> Iterator[str]:
    """The rows as text, some thousand at a time; reading gives the same bits, Booleans are 0 and 1."""
    for first in range(0, len(block), _PIECE):
        piece = block.some(slice(first, first + _PIECE))
        # Whole columns become text at once, which is several times faster than row by row.
        columns = [map(repr, piece.times.tolist())]
        for channel in piece.channels.all:
            column = piece.column(channel)
            columns.append(map(repr, (column.astype(np.int8) if channel.boolean else column).tolist()))
        yield "".join(",".join(line) + "\n" for line in zip(*columns, strict=True))


class CsvFile:
    """A CSV to which blocks are appended. A file of this name is replaced.

    After a crash its last line may be cut off. ``size`` (from ``position`` of a former process) goes on behind so many
    bytes; what that process wrote after them is cut off.

    Raises (the class itself):
        CosimError: the file is shorter than ``size``.
        OSError: it cannot be written.
    """

    def __init__(self, path: Path, channels: Channels, metadata: Mapping[str, Any], size: int | None = None) -> None:
        self.path = path
        self._channels = channels
        if size is not None:
            if not path.is_file() or path.stat().st_size < size:
                raise CosimError(f"{path}: holds less than when the checkpoint was written; the run cannot go on in it")
            os.truncate(path, size)
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("w" if size is None else "a", encoding="utf-8", newline="")
            if size is None:
                metadata_path(path).write_text(json.dumps(metadata, indent=1) + "\n", encoding="utf-8")
                self._file.write(header(channels))
                self._file.flush()

    def take(self, block: Block) -> bool:
        """Append rows; the block itself is not kept."""
        with self._writing():
            self._file.writelines(lines(block))
            self._file.flush()
        return False

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """A file that could not be written is closed: nothing more can be taken."""
        try:
            with written(self.path):
                yield
        except OSError:
            with suppress(OSError):
                self._file.close()
            raise

    def position(self) -> dict[str, int]:
        """The size of the file, all of it on the disk."""
        with self._writing():
            self._file.flush()
            os.fsync(self._file.fileno())
        return {"size": self._file.tell()}

    def close(self) -> CsvColumns:
        """End writing; the columns can be read."""
        self._file.close()
        return CsvColumns(self.path, self._channels)


class CsvColumns:
    """The columns of a CSV, read when they are asked for."""

    def __init__(self, path: Path, channels: Channels) -> None:
        self._path = path
        self._numbers = {channel.name: number for number, channel in enumerate(channels.all, start=1)}

    @cached_property
    def times(self) -> Column:
        """The column of times, (rows,) s."""
        return self._read(0, np.dtype(np.float64))

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""
        dtype = np.dtype(np.int8) if channel.boolean else channel.dtype
        return self._read(self._numbers[channel.name], dtype).astype(channel.dtype, copy=False)

    def _read(self, number: int, dtype: np.dtype[Any]) -> Column:
        return np.loadtxt(self._path, dtype, delimiter=",", skiprows=1, usecols=[number], ndmin=1, encoding="utf-8")
