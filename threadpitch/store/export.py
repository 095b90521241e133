"""A run -> files that other programs read: CSV, JSON, Parquet.

    run-12.json            all that the store has of the run, lengths in mm
    run-12-pitch.csv       a row for every P(n)
    run-12-pitch.parquet   the same, with units as metadata of the columns and the run as metadata of the file
    run-12-trace.parquet   the trace, as it is in the store

Files are called by the run's number, never by what a user or a log says.
"""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from threadpitch.store.documents import degrees, length, run_document
from threadpitch.store.errors import StoreError
from threadpitch.store.records import StoredRun, new_uid

FORMATS = ("csv", "json", "parquet")
COLUMNS = {  # name -> unit
    "calculator": "", "pass": "", "start_angle_deg": "deg", "n": "", "pitch_mm": "mm", "deviation_um": "um",
    "uncertainty_um": "um", "in_metal": "",
}
_METADATA = b"threadpitch"


def export(run: StoredRun, folder: Path, form: str) -> list[Path]:
    """Write the run into a folder (made if need be); files of these names are replaced, each in one move.

    Raises:
        StoreError: the format is not known, the trace is missing.
        OSError: the folder cannot be written.
    """
    if form not in FORMATS:
        raise StoreError(f"format {form!r} is not known; choose {', '.join(FORMATS[:-1])} or {FORMATS[-1]}")
    folder.mkdir(parents=True, exist_ok=True)
    name = f"run-{run.summary.number}"
    if form == "csv":
        return [_written(folder / f"{name}-pitch.csv", lambda path: _write_csv(run, path))]
    if form == "json":
        text = json.dumps(run_document(run), indent=1, allow_nan=False) + "\n"
        return [_written(folder / f"{name}.json", lambda path: path.write_text(text, encoding="utf-8"))]
    written = [_written(folder / f"{name}-pitch.parquet", lambda path: _write_parquet(run, path))]
    trace = run.trace
    if trace is None:
        return written
    if not trace.exists():
        raise StoreError(f"{trace}: the trace of run {run.summary.number} is not there; `threadpitch store verify` "
                         "tells what else")
    return [*written, _written(folder / f"{name}-trace.parquet", lambda path: shutil.copyfile(trace, path))]


def _rows(run: StoredRun) -> Iterator[tuple[Any, ...]]:
    """The cells of ``COLUMNS`` for every turn that is there."""
    for one in run.passes:
        for row, angle in enumerate(one.table.start_angles.tolist()):
            for turn, pitch in enumerate(one.table.pitch[row].tolist()):
                if not math.isnan(pitch):
                    uncertainty = None if one.table.uncertainty is None else float(one.table.uncertainty[row, turn])
                    yield (one.calculator, one.label, degrees(angle), turn + 1, length(pitch, "mm"),
                           None if one.target is None else length(pitch - one.target, "um"),
                           length(uncertainty, "um"), None if one.in_metal is None else bool(one.in_metal[row, turn]))


def _write_csv(run: StoredRun, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in _rows(run):
            writer.writerow([int(cell) if isinstance(cell, bool) else _harmless(cell) for cell in row])


def _harmless(cell: Any) -> Any:
    """Text that a spreadsheet would take for a formula gets an apostrophe in front."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(("=", "+", "-", "@", "\t", "\r")) else cell


def _write_parquet(run: StoredRun, path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    types = {"calculator": pyarrow.string(), "pass": pyarrow.string(), "n": pyarrow.int32(),
             "in_metal": pyarrow.bool_()}
    fields = [pyarrow.field(name, types.get(name, pyarrow.float64()), metadata={"unit": unit} if unit else None)
              for name, unit in COLUMNS.items()]
    about = json.dumps(run_document(run) | {"passes": None}, allow_nan=False)
    schema = pyarrow.schema(fields, metadata={_METADATA: about})
    columns = list(zip(*_rows(run), strict=True)) or [()] * len(fields)
    arrays = [pyarrow.array(list(values), field.type) for values, field in zip(columns, schema, strict=True)]
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=schema), path, compression="zstd")


def _written(path: Path, write: Callable[[Path], object]) -> Path:
    """Write a file under another name first, so that it appears whole or not at all."""
    temporary = path.with_name(f".{path.name}.{new_uid()}")
    try:
        write(temporary)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path
