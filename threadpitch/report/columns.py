"""Columns by their names out of a recorded result: ``trace.csv``, another CSV, Parquet as a file or a folder."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from threadpitch.report.content import ReportError
from threadpitch.trace import FloatArray


def read_columns(path: Path, names: Iterable[str], group: tuple[str, str] | None = None) -> dict[str, FloatArray]:
    """Those of the columns that are there, (rows,) each as float64, in the units of the file.

    ``group``: column and value of the rows that are wanted, in Parquet.

    Raises:
        ReportError: the file cannot be read as a recorded result, or Parquet needs pyarrow.
        OSError: the file is not there.
    """
    if path.suffix == ".csv":
        return _of_csv(path, names)
    if path.suffix == ".parquet":
        return _of_parquet(path, names, group)
    raise ReportError(f"{path}: results for a report are read from .csv and .parquet; record into one of them")


def _of_csv(path: Path, names: Iterable[str]) -> dict[str, FloatArray]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            header = next(csv.reader(file), [])
            places = {title.rpartition(" [")[0] or title: number for number, title in enumerate(header)}
            wanted = {name: places[name] for name in names if name in places}
            if not wanted:
                return {}
            values = np.loadtxt(file, delimiter=",", usecols=list(wanted.values()), ndmin=2, comments=None)
    except (ValueError, UnicodeDecodeError) as error:
        raise ReportError(f"{path}: is no recorded result ({' '.join(str(error).split())}); cut off a damaged last "
                          "line, or run again") from None
    return {name: np.ascontiguousarray(values[:, number]) for number, name in enumerate(wanted)}


def _of_parquet(path: Path, names: Iterable[str], group: tuple[str, str] | None) -> dict[str, FloatArray]:
    try:
        import pyarrow
        import pyarrow.compute
        import pyarrow.parquet as parquet
    except ImportError:
        raise ReportError(f"{path}: reading Parquet needs pyarrow, which is not installed; "
                          "pip install 'threadpitch[parquet]'") from None
    if not path.exists():
        raise FileNotFoundError(2, "no such file or directory", str(path))
    try:
        parts = sorted(path.glob("part-*.parquet")) if path.is_dir() else [path]
        known = parquet.read_schema(parts[0]).names if parts else []
        wanted = [name for name in names if name in known]
        by = [] if group is None else [group[0]]
        table = pyarrow.concat_tables([parquet.ParquetFile(part).read(columns=[*wanted, *by]) for part in parts]) \
            if parts else None
        if table is not None and group is not None:
            table = table.filter(pyarrow.compute.equal(table.column(group[0]), group[1]))
    except (pyarrow.ArrowInvalid, OSError) as error:
        raise ReportError(f"{path}: is no recorded result ({' '.join(str(error).split())}); run again") from None
    if table is None:
        return {}
    return {name: np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in wanted}
