"""Memory and time of long runs with results in Parquet: they do not grow with the length of the run.

    python -m tests.benchmarks.bench_long_run                 10^5, 10^7 and 10^8 steps; a few minutes, 2 GB of disk
    python -m tests.benchmarks.bench_long_run 100000 1000000

One small native FMU in the compiled loop, recorded at every step and at every thousandth. Each run has a process of its
own, whose peak memory is what the operating system says of it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

STEPS = (10**5, 10**7, 10**8)
EVERY = (1, 1000)
STEP_SIZE = 1e-7  # s: the decay stays far from zero
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class LongRun:
    """What one run took: bytes of memory at its peak and of Parquet, seconds of the steps, recorded rows."""

    memory: int
    disk: int
    seconds: float
    rows: int


def long_run(steps: int, every: int) -> LongRun:
    """The run in this process, which begins with it."""
    import resource  # not on Windows

    from threadpitch import cosim
    from threadpitch.cosim.system import Component, System
    from threadpitch.fmu import cached_fmu

    decay = System("decay", (Component("decay", cached_fmu(ROOT / "tests/cosim/models/decay.py", "native")),))
    cosim.simulate(decay, stop_time=STEP_SIZE, step_size=STEP_SIZE, engine="kernel")  # compiles, or loads what was
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.parquet"
        result = cosim.simulate(decay, stop_time=steps * STEP_SIZE, step_size=STEP_SIZE, engine="kernel", results=rows,
                                record_every=every)
        disk = sum(part.stat().st_size for part in rows.iterdir())
    return LongRun(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, disk, result.wall_time, result.rows)


def alone(steps: int, every: int) -> LongRun:
    """The run in a process of its own.

    Raises:
        AssertionError: rows are missing.
    """
    done = subprocess.run([sys.executable, "-m", __spec__.name, "--one", str(steps), str(every)], cwd=ROOT, check=True,
                          stdout=subprocess.PIPE, text=True)
    found = LongRun(**json.loads(done.stdout.splitlines()[-1]))
    assert found.rows == steps // every + 1
    return found


def main() -> None:
    """Prints the table, one run after the other."""
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(asdict(long_run(*map(int, sys.argv[2:])))))
        return
    table = Table("steps", "every n-th recorded", "peak memory, MB", "us per step", "Parquet, MB",
                  title="One small native FMU, results to Parquet while running")
    for every in EVERY:
        for steps in map(int, sys.argv[1:]) if sys.argv[1:] else STEPS:
            found = alone(steps, every)
            table.add_row(f"{steps:,}", f"{every}", f"{found.memory / 1e6:.0f}", f"{found.seconds / steps * 1e6:.3f}",
                          f"{found.disk / 1e6:.1f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
