"""The files of ``ArrayLog``, each opened by the library of its format, and read in chunks where that can."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.trace.array_log import Array, ArrayLog, Chunks
from threadpitch.trace.choice import ColumnChoice
from threadpitch.trace.recording import TraceError

CHUNK = 1 << 18  # rows that are read at once
_MAGIC = ((b"PAR1", "Parquet"), (b"\x89HDF\r\n\x1a\n", "HDF5"), (b"TDSm", "TDMS"), (b"MDF     ", "MDF"),
          (b"UnFinMF ", "MDF"), (b"MATLAB 5.0", "MAT"))
_USER_BLOCK = 512  # bytes before the HDF5 of a MAT file of version 7.3


def array_format(path: Path) -> str:
    """The format that a file begins with; "" for none of them."""
    if path.is_dir():
        return "Parquet" if any(path.glob("*.parquet")) else ""
    try:
        with open(path, "rb") as file:
            start = file.read(_USER_BLOCK + 8)
    except OSError:
        return ""
    if start[_USER_BLOCK:].startswith(b"\x89HDF"):
        return "HDF5"
    return next((name for magic, name in _MAGIC if start.startswith(magic)), "")


def array_log(path: Path, name: str, choice: ColumnChoice) -> ArrayLog:
    """The log in a file of one of the formats of ``array_format``.

    Raises:
        TraceError: the library is missing, the file is damaged, a column is not there or cannot be told.
    """
    openers: dict[str, Callable[[Path, ColumnChoice], ArrayLog]] = {
        "Parquet": _parquet, "HDF5": _hdf5, "TDMS": _tdms, "MDF": _mdf, "MAT": _mat}
    with _damage_named(path, name):
        return openers[name](path, choice)


@contextmanager
def _damage_named(path: Path, name: str) -> Iterator[None]:
    try:
        yield
    except (TraceError, KeyboardInterrupt, GeneratorExit):
        raise
    except Exception as error:  # the libraries raise whatever a damaged file leads them to
        text = " ".join(str(error).split())[:120] or type(error).__name__
        reason = "".join(letter if letter.isprintable() else "?" for letter in text)
        raise TraceError(f"{path}: cannot be read as {name} ({reason}); copy or record it again") from None


def _library(module: str, path: Path, extra: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise TraceError(f"{path}: needs {module.partition('.')[0]}, which is not installed; "
                         f"pip install 'threadpitch[{extra}]', or export the log as CSV") from None


def _log(path: Path, name: str, columns: Sequence[tuple[str, str]], chunks: Chunks, choice: ColumnChoice) -> ArrayLog:
    def guarded(wanted: Sequence[int]) -> Generator[list[Array]]:
        with _damage_named(path, name):
            yield from chunks(wanted)

    return ArrayLog(str(path), [column for column, _ in columns], [unit for _, unit in columns], guarded, choice)


def _parquet(path: Path, choice: ColumnChoice) -> ArrayLog:
    """A file, or a folder of part files; columns may carry a ``unit`` in their metadata."""
    parquet = _library("pyarrow.parquet", path, "parquet")
    parts = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    schema = parquet.read_schema(parts[0])
    columns = [(field.name, (field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace")) for field in schema]

    def chunks(wanted: Sequence[int]) -> Generator[list[Array]]:
        names = [columns[i][0] for i in wanted]
        for part in parts:
            with parquet.ParquetFile(part) as file:
                for group in range(file.num_row_groups):  # one by one: memory is given back only at their ends
                    for batch in file.iter_batches(batch_size=CHUNK, row_groups=[group], columns=names):
                        yield [batch.column(name).to_numpy(zero_copy_only=False) for name in names]

    return _log(path, "Parquet", columns, chunks, choice)


def _hdf5(path: Path, choice: ColumnChoice) -> ArrayLog:
    """All datasets of one dimension, or of one row or column (MATLAB 7.3), by their path."""
    h5py = _library("h5py", path, "hdf5")
    columns: list[tuple[str, str]] = []

    def visit(name: str, found: Any) -> None:
        vector = isinstance(found, h5py.Dataset) and found.size == max(found.shape, default=0)
        if vector and found.dtype.kind in "fiubSO":
            unit = found.attrs.get("unit", found.attrs.get("units", ""))
            columns.append((name, unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)))

    with h5py.File(path, "r") as file:
        file.visititems(visit)

    def chunks(wanted: Sequence[int]) -> Generator[list[Array]]:
        with h5py.File(path, "r") as file:
            sets = [file[columns[i][0]] for i in wanted]
            lengths = {max(one.shape, default=0) for one in sets}
            step = CHUNK if len(lengths) == 1 else max(lengths)
            for first in range(0, max(lengths), step):
                part = slice(first, first + step)
                yield [np.asarray(one[part] if one.ndim == 1 else np.asarray(one[...]).ravel()[part]) for one in sets]

    return _log(path, "HDF5", columns, chunks, choice)


def _mat(path: Path, choice: ColumnChoice) -> ArrayLog:
    """MATLAB up to version 7: all vectors."""
    from scipy.io import loadmat  # takes its time to load

    vectors = {name: np.asarray(value).ravel() for name, value in loadmat(path).items()
               if not name.startswith("__") and np.size(value) == max(np.shape(value), default=0) > 1}
    columns = [(name, "") for name in vectors]

    def chunks(wanted: Sequence[int]) -> Generator[list[Array]]:
        yield [vectors[columns[i][0]] for i in wanted]

    return _log(path, "MAT", columns, chunks, choice)


def _tdms(path: Path, choice: ColumnChoice) -> ArrayLog:
    """Channels by their name, or group/name where a name is there twice; the time may be that of the waveform."""
    nptdms = _library("nptdms", path, "tdms")
    nptdms.log.log_manager.set_level(logging.ERROR)  # what it warns of becomes an error here, in one line
    with nptdms.TdmsFile.read_metadata(path) as file:
        channels = [(group.name, channel.name, channel.properties) for group in file.groups() for channel in
                    group.channels()]
    names = [name for _, name, _ in channels]
    columns = [(name if names.count(name) == 1 else f"{group}/{name}", str(properties.get("unit_string", "")))
               for group, name, properties in channels]
    increments = [float(properties["wf_increment"]) for _, _, properties in channels if "wf_increment" in properties]
    if increments:
        columns.append(("time", "s"))

    def chunks(wanted: Sequence[int]) -> Generator[list[Array]]:
        with nptdms.TdmsFile.open(path) as file:
            found = [file[channels[i][0]][channels[i][1]] if i < len(channels) else None for i in wanted]
            lengths = {len(channel) for channel in found if channel is not None}
            step = CHUNK if len(lengths) == 1 else max(lengths)
            for first in range(0, max(lengths), step):
                last = min(first + step, max(lengths))
                yield [increments[0] * np.arange(first, last) if channel is None else np.asarray(channel[first:last])
                       for channel in found]

    return _log(path, "TDMS", columns, chunks, choice)


def _mdf(path: Path, choice: ColumnChoice) -> ArrayLog:
    """Channels of MDF 3 and 4; those of other rates are interpolated at the instants of the angle."""
    asammdf = _library("asammdf", path, "mdf")
    for reader in (asammdf.blocks.mdf_v3.MDF3, asammdf.blocks.mdf_v4.MDF4):
        _silence_the_end(reader)
    with asammdf.MDF(path) as file:
        places = [(g, c) for g, group in enumerate(file.groups) for c, _ in enumerate(group.channels)
                  if file.masters_db.get(g) != c]
        columns = [(file.groups[g].channels[c].name, file.groups[g].channels[c].unit or "") for g, c in places]
    columns.append(("time", "s"))

    def chunks(wanted: Sequence[int]) -> Generator[list[Array]]:
        with asammdf.MDF(path) as file:
            signals: list[Any] = [None if i == len(places) else file.get(group=places[i][0], index=places[i][1])
                                  for i in wanted]
        instants = signals[0].timestamps
        yield [instants if one is None else _at(instants, one.timestamps, np.asarray(one.samples)) for one in signals]

    return _log(path, "MDF", columns, chunks, choice)


def _silence_the_end(reader: Any) -> None:
    """asammdf's ``__del__`` fails, which Python prints, when the file could not be opened."""
    end = reader.__del__
    if getattr(end, "__name__", "") == "silent":
        return

    def silent(self: Any) -> None:
        with suppress(Exception):
            end(self)

    reader.__del__ = silent


def _at(instants: Array, own: Array, values: Array) -> Array:
    """The values at other instants: interpolated linearly; what is no floating number holds until it changes."""
    if own.shape == instants.shape and np.array_equal(own, instants):
        return values
    if values.dtype.kind == "f":
        return np.interp(instants, own, values)
    return values[np.maximum(np.searchsorted(own, instants, side="right") - 1, 0)]
