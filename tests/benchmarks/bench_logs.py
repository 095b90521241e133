"""Streaming Parquet and CSV logs: speed against reading them without analysis, and peak memory when they grow.

    python -m tests.benchmarks.bench_logs [samples]

Every figure of the first table is of a process of its own; the best of three is taken. The second table has the ratio
of reading a Parquet log to analysing it, one after the other in one process, in every one of many rounds: median and
extremes by the clock, median by processor time. Reading and analysing go on at the same time; on a machine with other
work single rounds by the clock say little.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import pyarrow
import pyarrow.csv
import pyarrow.parquet
from rich.console import Console
from rich.table import Table

from threadpitch.pitch import stream_pitches
from threadpitch.trace import ColumnChoice, fast_text
from threadpitch.trace.array_files import CHUNK

SAMPLES = 100_000_000
CSV_SHARE = 20  # a CSV log is so many times shorter: it takes that much longer
ROWS_SHARE = 10  # and what is read row by row is shorter again
SAMPLES_PER_TURN = 500.0
PART = 1_000_000  # samples per row group
REPEATS = 3
ROUNDS = 15
COLUMNS = ["spindle_revs", "z_mm"]


def write(path: Path, samples: int) -> None:
    """A spindle with ripple, an axis that lags, with the last digits of a measurement."""
    schema = pyarrow.schema([(name, pyarrow.float64()) for name in COLUMNS])
    with pyarrow.parquet.ParquetWriter(path, schema, use_dictionary=False) as file:
        for first in range(0, samples, PART):
            revs = np.arange(first, min(first + PART, samples)) / SAMPLES_PER_TURN
            revs += 1e-4 * np.sin(0.37 * revs)
            file.write_table(pyarrow.table([revs, 1.5 * revs + 1e-3 * np.sin(0.11 * revs)], schema=schema))


def write_csv(path: Path, samples: int) -> None:
    """The same recording as text, with time and pass."""
    options = pyarrow.csv.WriteOptions(quoting_style="none")
    schema = pyarrow.schema([("time_s", pyarrow.float64()), *((name, pyarrow.float64()) for name in COLUMNS),
                             ("pass", pyarrow.int64())])
    with pyarrow.csv.CSVWriter(path, schema, write_options=options) as file:
        for first in range(0, samples, PART):
            numbers = np.arange(first, min(first + PART, samples))
            revs = numbers / SAMPLES_PER_TURN
            revs += 1e-4 * np.sin(0.37 * revs)
            z = 1.5 * revs + 1e-3 * np.sin(0.11 * revs)
            columns = [np.round(1e-3 * numbers, 3), np.round(revs, 7), np.round(z, 6), np.ones_like(numbers)]
            file.write_table(pyarrow.table(columns, schema=schema))


def read_csv(path: Path) -> int:
    """The batches of a CSV log as numpy arrays, by pyarrow alone."""
    rows = 0
    with pyarrow.csv.open_csv(path) as file:
        for batch in file:
            rows += next(batch.column(name).to_numpy(zero_copy_only=False) for name in COLUMNS).size
    return rows


def analyse_rows(path: Path) -> int:
    """Turns found, where pyarrow is not installed."""
    fast_text.columns_of = lambda *_: None  # in this process only
    return analyse(path)


def read(path: Path) -> int:
    """What any analysis has to do: the batches as numpy arrays."""
    rows = 0
    with pyarrow.parquet.ParquetFile(path) as file:
        for group in range(file.num_row_groups):
            for batch in file.iter_batches(batch_size=CHUNK, row_groups=[group], columns=COLUMNS):
                arrays = [batch.column(name).to_numpy(zero_copy_only=False) for name in COLUMNS]
                rows += arrays[0].size
    return rows


def analyse(path: Path) -> int:
    """Turns found."""
    return sum(group.table.pitch.size for group in stream_pitches(path, ColumnChoice()))


def measured(what: str, path: Path) -> tuple[float, float, float]:
    """(s, s of the processors, MiB peak) of one run."""
    run = subprocess.run([sys.executable, "-m", "tests.benchmarks.bench_logs", what, str(path)], check=True,
                         capture_output=True, text=True)
    seconds, processors, peak = json.loads(run.stdout)
    return seconds, processors, peak


def in_turn(path: Path) -> list[str]:
    """The ratios of a round: reading to analysing."""
    read(path)
    analyse(path)
    by_clock, by_processor = [], []
    for _ in range(ROUNDS):
        begin, spent = perf_counter(), process_time()
        read(path)
        middle, spent_reading = perf_counter(), process_time() - spent
        analyse(path)
        by_clock.append((middle - begin) / (perf_counter() - middle))
        by_processor.append(spent_reading / (process_time() - spent - spent_reading))
    return [f"{value:.2f}" for value in (np.median(by_clock), min(by_clock), max(by_clock), np.median(by_processor))]


def rows_of(kind: str, size: int, folder: Path) -> Iterator[list[str]]:
    """The rows of the table: one log of a kind, read and analysed."""
    path = folder / f"log.{kind}"
    WRITERS[kind](path, size)
    runs = {"parquet": ["read", "analyse"], "csv": ["read_csv", "analyse"], "rows.csv": ["read_csv", "analyse_rows"]}
    rounds = [{what: measured(what, path) for what in runs[kind]} for _ in range(REPEATS)]
    best = {what: min(one[what][0] for one in rounds) for what in rounds[0]}
    spent = {what: min(one[what][1] for one in rounds) for what in rounds[0]}
    peak = {what: max(one[what][2] for one in rounds) for what in rounds[0]}
    reading, reading_spent = best[runs[kind][0]], spent[runs[kind][0]]
    for what, seconds in best.items():
        yield [kind, f"{size:,}", what, f"{seconds:.3f}", f"{size / seconds / 1e6:.2f}", f"{reading / seconds:.2f}",
               f"{reading_spent / spent[what]:.2f}", f"{peak[what]:.0f}"]
    path.unlink()


def main() -> None:
    """Prints the table."""
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES
    ratios = Table(title=f"Speed of analysing Parquet, of the speed of reading it, {ROUNDS} rounds in turn")
    for heading in ("samples", "median", "least", "greatest", "median by processor time"):
        ratios.add_column(heading, justify="right")
    table = Table(title="Logs that are streamed")
    for heading in ("log", "samples", "what", "s", "million samples/s", "of the speed of reading", "by processor time",
                    "peak MiB"):
        table.add_column(heading, justify="right")
    csv = samples // CSV_SHARE
    with tempfile.TemporaryDirectory() as folder:
        for kind, size in (("parquet", samples // 100), ("parquet", samples), ("csv", csv // 10), ("csv", csv),
                           ("rows.csv", csv // ROWS_SHARE)):
            for row in rows_of(kind, size, Path(folder)):
                table.add_row(*row)
        write(Path(folder) / "log.parquet", samples // 2)
        ratios.add_row(f"{samples // 2:,}", *in_turn(Path(folder) / "log.parquet"))
    Console(width=120).print(table)
    Console(width=120).print(ratios)


def measure(what: str, path: Path) -> None:
    """In the process of its own."""
    with tempfile.TemporaryDirectory() as folder:  # libraries and compiled functions are loaded before
        small = Path(folder) / path.name
        WRITERS[path.name.removeprefix("log.")](small, 10_000)
        RUNS[what](small)
    begin, spent = perf_counter(), process_time()
    RUNS[what](path)
    seconds, spent = perf_counter() - begin, process_time() - spent
    print(json.dumps([seconds, spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0]))


WRITERS = {"parquet": write, "csv": write_csv, "rows.csv": write_csv}
RUNS = {"read": read, "analyse": analyse, "read_csv": read_csv, "analyse_rows": analyse_rows}

if __name__ == "__main__":
    if len(sys.argv) > 2:
        measure(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
