"""Streaming a Parquet log: speed against reading it without analysis, and peak memory when it grows 100 times.

    python -m tests.benchmarks.bench_logs [samples]

Every figure is of a process of its own; the best of three is taken.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import pyarrow
import pyarrow.parquet
from rich.console import Console
from rich.table import Table

from threadpitch.pitch import stream_pitches
from threadpitch.trace import ColumnChoice
from threadpitch.trace.array_files import CHUNK

SAMPLES = 100_000_000
SAMPLES_PER_TURN = 500.0
PART = 1_000_000  # samples per row group
REPEATS = 3
COLUMNS = ["spindle_revs", "z_mm"]


def write(path: Path, samples: int) -> None:
    """A spindle with ripple, an axis that lags, with the last digits of a measurement."""
    schema = pyarrow.schema([(name, pyarrow.float64()) for name in COLUMNS])
    with pyarrow.parquet.ParquetWriter(path, schema, use_dictionary=False) as file:
        for first in range(0, samples, PART):
            revs = np.arange(first, min(first + PART, samples)) / SAMPLES_PER_TURN
            revs += 1e-4 * np.sin(0.37 * revs)
            file.write_table(pyarrow.table([revs, 1.5 * revs + 1e-3 * np.sin(0.11 * revs)], schema=schema))


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


def measured(what: str, path: Path) -> tuple[float, float]:
    """(s, MiB peak) of one run."""
    run = subprocess.run([sys.executable, "-m", "tests.benchmarks.bench_logs", what, str(path)], check=True,
                         capture_output=True, text=True)
    seconds, peak = json.loads(run.stdout)
    return seconds, peak


def main() -> None:
    """Prints the table."""
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES
    table = Table(title="Parquet log")
    for heading in ("samples", "what", "s", "million samples/s", "of the speed of reading", "peak MiB"):
        table.add_column(heading, justify="right")
    with tempfile.TemporaryDirectory() as folder:
        for size in (samples // 100, samples):
            path = Path(folder) / "log.parquet"
            write(path, size)
            rounds = [{what: measured(what, path) for what in ("read", "analyse")} for _ in range(REPEATS)]
            best = {what: min(one[what][0] for one in rounds) for what in rounds[0]}
            peak = {what: max(one[what][1] for one in rounds) for what in rounds[0]}
            for what, seconds in best.items():
                table.add_row(f"{size:,}", what, f"{seconds:.3f}", f"{size / seconds / 1e6:.1f}",
                              f"{best['read'] / seconds:.2f}", f"{peak[what]:.0f}")
    Console(width=110).print(table)


def measure(what: str, path: Path) -> None:
    """In the process of its own."""
    run = {"read": read, "analyse": analyse}[what]
    with tempfile.TemporaryDirectory() as folder:  # libraries and compiled functions are loaded before
        write(Path(folder) / "small.parquet", 10_000)
        run(Path(folder) / "small.parquet")
    begin = perf_counter()
    run(path)
    seconds = perf_counter() - begin
    print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0]))


if __name__ == "__main__":
    if len(sys.argv) > 2:
        measure(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
