"""Traces as Parquet: one file of a log's samples, one of a simulation's rows; memory does not grow with their length.

They hold no time of day, so that the same log gives the same bits, and the store keeps it once.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim.parquet import METADATA, part_files
from threadpitch.lathe import Simulation
from threadpitch.trace import FloatArray

_ROWS = 2**17  # of a row group


def _arrow() -> Any:
    import pyarrow
    import pyarrow.parquet

    return pyarrow


class LogTrace:
    """A Parquet file that the samples of a log go into, piece by piece: time [s], angle [rad], position [m], group."""

    def __init__(self, path: Path) -> None:
        arrow = self._arrow = _arrow()
        units = {"time": "s", "angle": "rad", "position": "m"}
        fields = [arrow.field(name, arrow.float64(), metadata={"unit": unit}) for name, unit in units.items()]
        self._schema = arrow.schema([*fields, arrow.field("group", arrow.string())])
        self._writer = arrow.parquet.ParquetWriter(path, self._schema, compression="zstd")
        self._waiting: list[Any] = []
        self._rows = 0

    def add(self, group: str, angle: FloatArray, position: FloatArray, time: FloatArray | None = None) -> None:
        """The next samples, (samples,) rad, m, s."""
        arrow = self._arrow
        columns = [arrow.nulls(angle.size, arrow.float64()) if time is None else arrow.array(time),
                   arrow.array(angle), arrow.array(position), arrow.repeat(group, angle.size)]
        self._waiting.append(arrow.Table.from_arrays(columns, schema=self._schema))
        self._rows += angle.size
        if self._rows >= _ROWS:
            self._write()

    def close(self) -> None:
        """End the file."""
        self._write()
        self._writer.close()

    def _write(self) -> None:
        if self._waiting:
            self._writer.write_table(self._arrow.concat_tables(self._waiting).combine_chunks())
        self._waiting, self._rows = [], 0


def simulation_trace(simulation: Simulation, path: Path) -> None:
    """Write all that was recorded: time and variables by ``component.variable``, with units and the metadata."""
    arrow = _arrow()
    result = simulation.result
    if result.path is not None and result.path.is_dir():
        parts = part_files(result.path)
        with arrow.parquet.ParquetWriter(path, arrow.parquet.read_schema(parts[0]), compression="zstd") as writer:
            for part in parts:
                writer.write_table(arrow.parquet.ParquetFile(part).read())
        return
    fields, columns = [arrow.field("time", arrow.float64(), metadata={"unit": "s"})], [arrow.array(result.time)]
    for name, values in _columns(simulation):
        columns.append(arrow.array(np.ascontiguousarray(values)))
        unit = result.units.get(name) or ""
        fields.append(arrow.field(name, columns[-1].type, metadata={"unit": unit} if unit else None))
    schema = arrow.schema(fields, metadata={METADATA: json.dumps(result.metadata)})
    arrow.parquet.write_table(arrow.Table.from_arrays(columns, schema=schema), path, compression="zstd")


def _columns(simulation: Simulation) -> Iterator[tuple[str, Any]]:
    for name in simulation.result:
        yield name, simulation.result[name]
