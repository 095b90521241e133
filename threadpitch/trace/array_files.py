"""The files of ``ArrayLog``, each opened by the library of its format, and read in chunks where that can."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.trace import sinumerik
from threadpitch.trace.array_log import ArrayLog, Chunk, Columns
from threadpitch.trace.channels import Channel, aligned, clock_notes
from threadpitch.trace.choice import ColumnChoice, brief, is_time, time_factor
from threadpitch.trace.cut_off import cut_off
from threadpitch.trace.mat_file import MOST_COLUMNS, MatFile
from threadpitch.trace.passes import Array
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray

CHUNK = 1 << 18  # rows that are read at once
_MAGIC = ((b"PAR1", "Parquet"), (b"\x89HDF\r\n\x1a\n", "HDF5"), (b"TDSm", "TDMS"), (b"MDF     ", "MDF"),
          (b"UnFinMF ", "MDF"), (b"MATLAB 5.0", "MAT"))
_USER_BLOCK = 512  # bytes before the HDF5 of a MAT file of version 7.3


def array_format(path: Path) -> str:
    """The format that a file begins with; "" for none of them."""
    if path.is_dir():
        return "Parquet" if any(path.glob("*.parquet")) else ""
    if not path.is_file():
        return ""  # of a pipe nothing may be read twice
    try:
        with open(path, "rb") as file:
            start = file.read(_USER_BLOCK + 8)
    except OSError:
        return ""
    if start[_USER_BLOCK:].startswith(b"\x89HDF"):
        return "HDF5"
    if sinumerik.ROOT in start:
        return "SINUMERIK trace"
    return next((name for magic, name in _MAGIC if start.startswith(magic)), "")


def array_log(path: Path, name: str, choice: ColumnChoice) -> ArrayLog:
    """The log in a file of one of the formats of ``array_format``.

    Raises:
        TraceError: the library is missing, the file is damaged, a column is not there or cannot be told.
    """
    openers: dict[str, Callable[[Path, ColumnChoice], ArrayLog]] = {
        "Parquet": _parquet, "HDF5": _hdf5, "TDMS": _tdms, "MDF": _mdf, "MAT": _mat,
        "SINUMERIK trace": _sinumerik}
    with _damage_named(path, name):
        if missing := cut_off(path, name):
            raise TraceError(f"the {name} file is cut off: {missing}; copy it again, or record it again")
        return openers[name](path, choice)


@contextmanager
def _damage_named(path: Path, name: str) -> Iterator[None]:
    try:
        yield
    except TraceError as error:
        raise error if str(error).startswith(str(path)) else TraceError(f"{path}: {error}") from None
    except (KeyboardInterrupt, GeneratorExit):
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


def _log(path: Path, name: str, columns: Columns, choice: ColumnChoice) -> ArrayLog:
    def guarded(wanted: Sequence[int]) -> Generator[Chunk]:
        with _damage_named(path, name):
            yield from columns.chunks(wanted)

    return ArrayLog(str(path), replace(columns, chunks=guarded), choice)


def _parquet(path: Path, choice: ColumnChoice) -> ArrayLog:
    """A file, or a folder of part files; columns may carry a ``unit`` in their metadata."""
    parquet = _library("pyarrow.parquet", path, "parquet")
    parts = sorted(path.glob("*.parquet")) if path.is_dir() else [path]
    schema = parquet.read_schema(parts[0])
    names = [field.name for field in schema]
    units = [(field.metadata or {}).get(b"unit", b"").decode("utf-8", "replace") for field in schema]

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        chosen = [names[i] for i in wanted]
        for number, part in enumerate(parts):
            with parquet.ParquetFile(part) as file:
                rows = 0
                for group in range(file.num_row_groups):  # one by one: memory is given back only at their ends
                    for batch in file.iter_batches(batch_size=CHUNK, row_groups=[group], columns=chosen):
                        rows += batch.num_rows
                        yield Chunk([batch.column(name).to_numpy(zero_copy_only=False) for name in chosen],
                                    (number + rows / max(file.metadata.num_rows, 1)) / len(parts))

    return _log(path, "Parquet", Columns(names, units, chunks), choice)


def _hdf5(path: Path, choice: ColumnChoice) -> ArrayLog:
    """All datasets of one dimension, or of one row or column (MATLAB 7.3), by their path; of tables each column.

    The clock of a dataset is the dataset called time of the same length in its group, or in the next one above.
    """
    h5py = _library("h5py", path, "hdf5")
    found: dict[str, tuple[int, str]] = {}  # path: length, unit
    tables: dict[str, tuple[str, int]] = {}  # column: dataset, place in there from 0

    def visit(name: str, one: Any) -> None:
        if not isinstance(one, h5py.Dataset) or one.dtype.kind not in "fiubSO":
            return
        unit = one.attrs.get("unit", one.attrs.get("units", ""))
        text = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
        if one.size == max(one.shape, default=0):
            found[name] = one.size, text
        elif one.ndim == 2 and min(one.shape) <= MOST_COLUMNS and one.size:
            for place in range(min(one.shape)):
                tables[f"{name}/{place + 1}"] = name, place
                found[f"{name}/{place + 1}"] = max(one.shape), ""

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    names = list(found)
    clocks = [_clock_beside(name, {other: size for other, (size, _) in found.items()}) for name in names]

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        with h5py.File(path, "r") as file:
            def vector(name: str) -> Callable[[int, int], Array]:
                dataset, place = tables.get(name, (name, 0))
                return partial(_vector, file[dataset], place)

            def channel(i: int) -> Channel:
                clock = clocks[i]
                seconds = 1.0 if clock is None else time_factor(clock, found[clock][1])
                return Channel(names[i], found[names[i]][0], vector(names[i]), clock,
                               None if clock is None else lambda a, b: seconds * vector(clock)(a, b))

            yield from aligned([channel(i) for i in wanted], CHUNK)

    return _log(path, "HDF5", Columns(names, [unit for _, unit in found.values()], chunks, notes=clock_notes(clocks)),
                choice)


def _clock_beside(name: str, sizes: dict[str, int]) -> str | None:
    """The time of a dataset: the nearest of the same length, in its group or above."""
    folder = name
    while folder:
        folder = folder.rpartition("/")[0]
        for other, size in sizes.items():
            parent, _, last = other.rpartition("/")
            if parent == folder and size == sizes[name] and is_time(last):
                return other
    return None


def _vector(dataset: Any, place: int, first: int, last: int) -> Array:
    """Samples of a vector, or of the column at this place of a table, whose longer side is the time."""
    if dataset.ndim == 1:
        return np.asarray(dataset[first:last])
    along = dataset.shape[0] >= dataset.shape[1]
    return np.asarray(dataset[first:last, place] if along else dataset[place, first:last])


def _mat(path: Path, choice: ColumnChoice) -> ArrayLog:
    """MATLAB up to version 7: what is chosen is held in memory."""
    file = MatFile(path)

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        yield Chunk(file.read(wanted))

    return _log(path, "MAT", Columns(file.names, [""] * len(file.names), chunks), choice)


def _tdms(path: Path, choice: ColumnChoice) -> ArrayLog:
    """Channels by their name, or group/name where a name is there twice; the time may be that of the waveform."""
    nptdms = _library("nptdms", path, "tdms")
    nptdms.log.log_manager.set_level(logging.ERROR)  # what it warns of becomes an error here, in one line
    with nptdms.TdmsFile.read_metadata(path) as file:
        found = [(group.name, channel.name, len(channel), dict(channel.properties)) for group in file.groups()
                 for channel in group.channels()]
    every = [name for _, name, _, _ in found]
    names = [name if every.count(name) == 1 else f"{group}/{name}" for group, name, _, _ in found]
    units = [str(properties.get("unit_string", "")) for _, _, _, properties in found]
    clocks = [_waveform(properties) or _clock_beside(f"{group}/{name}", {f"{a}/{b}": size for a, b, size, _ in found})
              for group, name, _, properties in found]
    if any(isinstance(clock, Waveform) for clock in clocks):
        names, units = [*names, "time"], [*units, "s"]

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        with nptdms.TdmsFile.open(path) as file:
            def samples(group: str, name: str, first: int, last: int) -> Array:
                return np.asarray(file[group][name][first:last])

            def channel(i: int) -> Channel:
                if i == len(found):
                    own = channel(wanted[0])
                    if own.instants is None:
                        raise TraceError(f"{path}: the angle has no time; name the time column")
                    return replace(own, name="time", read=own.instants)
                group, name, size, _ = found[i]
                clock, instants = clocks[i], None
                if isinstance(clock, Waveform):
                    beginning = clocks[wanted[0]]
                    instants = clock.instants(beginning if isinstance(beginning, Waveform) else clock)
                elif clock is not None:
                    seconds, (folder, _, last) = time_factor(clock, ""), clock.rpartition("/")
                    instants = lambda a, b: seconds * samples(folder, last, a, b)  # noqa: E731 -- it is one of two
                return Channel(names[i], size, partial(samples, group, name), clock, instants)

            yield from aligned([channel(i) for i in wanted], CHUNK)

    return _log(path, "TDMS", Columns(names, units, chunks, len(names) > len(found),
                                      notes=clock_notes([*clocks, None])), choice)


@dataclass(frozen=True)
class Waveform:
    """Time of a TDMS channel: t_k = start + offset + k increment."""

    start: np.datetime64 | None
    offset: float  # s
    increment: float  # s

    def instants(self, reference: Waveform) -> Callable[[int, int], FloatArray]:
        """s, from the start of another waveform."""
        begin = self.offset
        if self.start is not None and reference.start is not None:
            begin += float((self.start - reference.start) / np.timedelta64(1, "us")) * 1e-6
        return lambda first, last: begin + self.increment * np.arange(first, last, dtype=np.float64)


def _waveform(properties: dict[str, Any]) -> Waveform | None:
    increment = float(properties.get("wf_increment", 0.0))
    if not increment > 0.0:
        return None
    return Waveform(properties.get("wf_start_time"), float(properties.get("wf_start_offset", 0.0)), increment)


def _mdf(path: Path, choice: ColumnChoice) -> ArrayLog:
    """Channels of MDF 3 and 4; the clock of each is its channel group."""
    asammdf = _library("asammdf", path, "mdf")
    for reader in (asammdf.blocks.mdf_v3.MDF3, asammdf.blocks.mdf_v4.MDF4):
        _silence_the_end(reader)
    with open(path, "rb") as stream, asammdf.MDF(stream) as file:  # asammdf leaves a damaged file open
        places = [(g, c) for g, group in enumerate(file.groups) for c, _ in enumerate(group.channels)
                  if file.masters_db.get(g) != c]
        names = [file.groups[g].channels[c].name for g, c in places]
        units = [file.get_channel_unit(group=g, index=c) or "" for g, c in places]  # MDF 3 keeps them in the conversion

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        with open(path, "rb") as stream, asammdf.MDF(stream) as file:  # asammdf leaves a damaged file open
            def channel(i: int) -> Channel:
                group, index = places[wanted[0] if i == len(places) else i]

                def instants(first: int, last: int) -> FloatArray:
                    return np.asarray(file.get_master(group, record_offset=first, record_count=last - first))

                def samples(first: int, last: int) -> Array:
                    return np.asarray(file.get(group=group, index=index, record_offset=first, samples_only=True,
                                               record_count=last - first)[0])

                if i == len(places):
                    return Channel("time", file.groups[group].channel_group.cycles_nr, instants, group, instants)
                return Channel(names[i], file.groups[group].channel_group.cycles_nr, samples, group, instants)

            yield from aligned([channel(i) for i in wanted], CHUNK)

    clocks = [group for group, _ in places]
    return _log(path, "MDF", Columns([*names, "time"], [*units, "s"], chunks, True,
                                     notes=clock_notes([*clocks, None])), choice)


def _sinumerik(path: Path, choice: ColumnChoice) -> ArrayLog:
    """A trace of SINUMERIK Operate: signals by description and address, each with the time of its samples."""
    session = sinumerik.read_session(path)
    names = [signal.name for signal in session.signals]
    sampled = [signal.sampled(session.end) for signal in session.signals]
    instants = [time for time, _ in sampled]
    clocks = [next(k for k, other in enumerate(instants) if np.array_equal(one, other)) for one in instants]

    def chunks(wanted: Sequence[int]) -> Generator[Chunk]:
        def channel(i: int) -> Channel:
            own = wanted[0] if i == len(names) else i
            time = instants[own]
            values = time if i == len(names) else sampled[i][1]
            return Channel([*names, "time"][i], time.size, lambda a, b: values[a:b], clocks[own],
                           lambda a, b: time[a:b])

        yield from aligned([channel(i) for i in wanted], CHUNK)

    more = session.frames - 1
    read = ("read as a trace of SINUMERIK Operate, whose layout is not published; it tells no units",
            *([f"{more} further data frames of the file are not read"] if more else []),
            *([f"the control tells of {brief(session.drop_outs)} drop-outs: samples it has lost"]
              if session.drop_outs.strip("0.") else []))
    columns = Columns([*names, "time"], [""] * len(names) + ["s"], chunks, True, sinumerik.ANGLE_UNIT,
                      lambda chosen: (*read, *clock_notes([*clocks, None])(chosen)))
    return _log(path, "SINUMERIK trace", columns, choice)


def _silence_the_end(reader: Any) -> None:
    """asammdf's ``__del__`` fails, which Python prints, when the file could not be opened."""
    end = reader.__del__
    if getattr(end, "__name__", "") == "silent":
        return

    def silent(self: Any) -> None:
        with suppress(Exception):
            end(self)

    reader.__del__ = silent
