"""Workers are killed at random while they compute a study: the table is complete, and equal to the undisturbed one.

    python -m tests.benchmarks.bench_killed_workers [rows] [seconds between kills]        default 2000, 10
"""

from __future__ import annotations

import random
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil  # type: ignore[import-untyped] # it ships no types

from threadpitch.studies import Place, study


def definition(rows: int, stop_time: float = 0.4) -> dict[str, Any]:
    """A study of the shipped lathe up to its first turns."""
    return {
        "study": {"design": "latin_hypercube", "samples": rows, "seed": 4, "stop_time": stop_time, "flavor": "native"},
        "parameters": {"z_drive.position_gain": {"from": 30, "to": 80}, "spindle.inertia": {"from": 0.1, "to": 0.2},
                       "controller.commanded_speed": {"from": "300rpm", "to": "600rpm"}},
        "outcomes": {"lag": "max(abs(z_drive.following_error))", "angle": "last(spindle.angle)"},
    }


@contextmanager
def killing(every: float, begun: threading.Event) -> Iterator[list[int]]:
    """Once rows have come, kill one of this process's workers every so many seconds; the list tells which."""
    killed: list[int] = []
    over = threading.Event()
    choice = random.Random(1)

    def kill() -> None:
        while not over.wait(every):
            if begun.is_set() and (workers := own_workers()):
                killed.append(choice.choice(workers).pid)
                psutil.Process(killed[-1]).kill()

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        yield killed
    finally:
        over.set()
        thread.join()


def own_workers() -> list[Any]:
    """The processes of Dask's workers that this process has started."""
    return [one for one in psutil.Process().children(recursive=True) if "spawn_main" in " ".join(_command(one))]


def _command(process: Any) -> list[str]:
    try:
        return list(process.cmdline())
    except psutil.Error:
        return []


def main() -> None:
    """Print what was killed, and whether the tables are equal."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    every = float(sys.argv[2]) if len(sys.argv) > 2 else 10.0
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        quiet = study(definition(rows), output=Path(folder) / "quiet", place=Place(workers=2))
        print(f"undisturbed: {rows} rows in {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
        begun = threading.Event()
        with killing(every, begun) as killed:
            disturbed = study(definition(rows), output=Path(folder) / "disturbed", place=Place(workers=2),
                              progress=lambda done, rows: begun.set())
        print(f"with {len(killed)} workers killed: {disturbed.analysis.rows} rows in "
              f"{time.perf_counter() - began:.1f} s, {disturbed.analysis.failed} failed, missing {disturbed.missing}")
        print("tables are equal" if disturbed.table.equals(quiet.table, check_metadata=True) else "TABLES DIFFER")


if __name__ == "__main__":
    main()
