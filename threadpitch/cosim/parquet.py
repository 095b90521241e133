"""Parquet: a folder of part files that grows while a run computes, each whole and readable at any moment.

A Parquet file can be read only when its end is written. So every block becomes a file of its own, which gets its name
when it is complete; pandas, polars, pyarrow, DuckDB and Spark read the folder as one table.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim.block import Block, Channel, Channels, Column
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.places import written

METADATA = b"threadpitch"
_PART = "part-{:06d}.parquet"
_UNFINISHED = ".unfinished.parquet"  # readers of folders pass over names with a dot


def _arrow() -> Any:
    try:
        import pyarrow.parquet
    except ImportError:
        raise CosimError("Parquet needs pyarrow, which is not installed; pip install 'threadpitch[parquet]', or write "
                         "CSV") from None
    return pyarrow


class ParquetFolder:
    """A folder ``part-000000.parquet``, ``part-000001.parquet``, ... Parts of a former run in it are removed.

    Every part carries the metadata under the key ``threadpitch``, and every column its ``unit``. ``parts`` (from
    ``position`` of a former process) goes on behind so many parts; those that this process wrote after them are
    removed.

    Raises (the class itself):
        CosimError: pyarrow is missing, the path is a file, holds parts of another table, or there are fewer parts.
        OSError: the folder cannot be written.
    """

    def __init__(self, path: Path, channels: Channels, metadata: Mapping[str, Any], parts: int = 0) -> None:
        self.path = path
        self._arrow = _arrow()
        self._channels = channels
        self._schema = self._make_schema(metadata)
        if path.exists() and not path.is_dir():
            raise CosimError(f"{path}: is a file; Parquet is written as a folder of files, choose another name")
        with written(path):
            path.mkdir(parents=True, exist_ok=True)
        there = set(part_files(path))
        wanted = [path / _PART.format(number) for number in range(parts)]
        missing = [part for part in wanted if part not in there]
        if missing:
            raise CosimError(f"{missing[0]}: is missing, but was there when the checkpoint was written; the run cannot "
                             "go on in this folder")
        former = sorted(there.difference(wanted))
        for part in former:
            if not self._is_ours(part):
                raise CosimError(f"{part}: comes from somewhere else; choose another folder for the results")
        for part in former:
            part.unlink()
        self._parts = parts

    def _is_ours(self, part: Path) -> bool:
        try:
            return METADATA in (self._arrow.parquet.read_schema(part).metadata or {})
        except (self._arrow.ArrowException, OSError):
            return False

    def _make_schema(self, metadata: Mapping[str, Any]) -> Any:
        arrow = self._arrow
        fields = [arrow.field("time", arrow.float64(), nullable=False, metadata={"unit": "s"})]
        for channel in self._channels.all:
            unit = {"unit": channel.variable.unit} if channel.variable.unit else None
            fields.append(arrow.field(channel.name, arrow.from_numpy_dtype(channel.dtype), nullable=False,
                                      metadata=unit))
        return arrow.schema(fields, metadata={METADATA: json.dumps(metadata)})

    def take(self, block: Block) -> bool:
        """Write a part; the block itself is not kept."""
        arrays = [self._arrow.array(block.times)]
        arrays += [self._arrow.array(block.column(channel)) for channel in self._channels.all]
        self._write(self._arrow.Table.from_arrays(arrays, schema=self._schema))
        return False

    def _write(self, table: Any) -> None:
        unfinished = self.path / _UNFINISHED
        try:
            with written(self.path):
                with unfinished.open("wb") as file:
                    self._arrow.parquet.write_table(table, file, compression="zstd")
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(unfinished, self.path / _PART.format(self._parts))
        except OSError:
            unfinished.unlink(missing_ok=True)  # what it has taken is free for the rest of the run's files
            raise
        self._parts += 1

    def position(self) -> dict[str, int]:
        """The number of parts."""
        return {"parts": self._parts}

    def close(self) -> ParquetColumns:
        """End writing; the columns can be read. A run without rows leaves a part without rows."""
        if not self._parts:
            self._write(self._schema.empty_table())
        return ParquetColumns(self.path)


class ParquetColumns:
    """The columns of a folder of parts, read when they are asked for."""

    def __init__(self, path: Path) -> None:
        self._parts = part_files(path)

    @cached_property
    def times(self) -> Column:
        """The column of times, (rows,) s."""
        return self._read("time")

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""
        return self._read(channel.name)

    def _read(self, name: str) -> Column:
        arrow = _arrow()
        # Part by part, not as a data set: column names hold dots, which there mean fields within fields.
        parts = [arrow.parquet.ParquetFile(part).read([name]).column(name).to_numpy() for part in self._parts]
        return np.concatenate(parts)


def part_files(path: Path) -> list[Path]:
    """The parts of a folder, in their order."""
    return sorted(path.glob("part-*.parquet"))


def read_metadata(path: Path) -> dict[str, Any]:
    """What a folder of parts says of itself.

    Raises:
        CosimError: there is no part, or it does not come from here.
    """
    parts = part_files(path)
    found = _arrow().parquet.read_schema(parts[0]).metadata if parts else None
    if not found or METADATA not in found:
        raise CosimError(f"{path}: holds no results of threadpitch")
    return dict(json.loads(found[METADATA]))
