"""Speed of `thread_pitch` against copying its two arrays, and of reading a log.

    python -m tests.benchmarks.bench_thread_pitch [samples]

Every sample is checked (NaN, reversal). The runs are interleaved and the best of each is taken, because other work on
the machine only makes a run slower.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

from threadpitch.pitch import thread_pitch
from threadpitch.trace import ColumnChoice, FloatArray, read_groups

TURN = 2.0 * math.pi
SAMPLES = 10_000_000
SAMPLES_PER_TURN = 500.0
REPEATS = 7
LOG = Path(__file__).parents[2] / "models" / "logs" / "linuxcnc" / "I_g76_ripple_400.csv.gz"


@dataclass(frozen=True)
class Figure:
    """One line of the benchmark."""

    what: str
    seconds: float
    samples: int

    @property
    def rate(self) -> float:
        """Million samples per second."""
        return self.samples / self.seconds / 1e6


def recording(samples: int) -> tuple[FloatArray, FloatArray]:
    """(samples,) rad and (samples,) m: a spindle with ripple, an axis that lags."""
    angle: FloatArray = np.linspace(0.0, TURN / SAMPLES_PER_TURN * samples, samples)
    angle += 1e-3 * np.sin(0.37 * angle)
    position: FloatArray = 1.5e-3 / TURN * angle + 1e-6 * np.sin(0.11 * angle)
    return angle, position


def jittering(angle: FloatArray) -> FloatArray:
    """The angle in counts of 4096 per turn that go back by one now and then."""
    counts = np.floor(angle / TURN * 4096.0)
    counts[10::1000] -= 1.0
    counts[11::1000] -= 10.0
    return counts * (TURN / 4096.0)


def evenly_spaced(count: int) -> FloatArray:
    """Start angles (count,) rad."""
    return TURN / count * np.arange(count, dtype=np.float64)


def best(runs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Shortest time of each, s; the first round compiles and warms up."""
    seconds = dict.fromkeys(runs, math.inf)
    for repeat in range(REPEATS + 1):
        for name, run in runs.items():
            begin = perf_counter()
            run()
            taken = perf_counter() - begin
            if repeat > 0:
                seconds[name] = min(seconds[name], taken)
    return seconds


def figures(samples: int = SAMPLES) -> list[Figure]:
    """Copying both arrays first, into new memory and into memory at hand, then `thread_pitch`, then the reader."""
    angle, position = recording(samples)
    shaken = jittering(angle)
    into = np.empty((2, samples))

    def copy_into_memory_at_hand() -> None:
        into[0], into[1] = angle, position

    runs: dict[str, Callable[[], object]] = {
        "copy of both arrays": lambda: (angle.copy(), position.copy()),
        "copy of both arrays into memory at hand": copy_into_memory_at_hand,
        "thread_pitch, counts that go back": lambda: thread_pitch(shaken, position),
    }
    for count in (1, 4, 32):
        runs[f"thread_pitch, {count} start angles"] = partial(thread_pitch, angle, position, evenly_spaced(count))
    found = [Figure(name, seconds, samples) for name, seconds in best(runs).items()]
    choice = ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass")
    rows = sum(trace.angle.size for trace in read_groups(LOG, choice))
    reading = best({"read_groups, .csv.gz of 10 columns": lambda: read_groups(LOG, choice)})
    return found + [Figure(name, seconds, rows) for name, seconds in reading.items()]


def main() -> None:
    """Prints the table."""
    found = figures(int(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES)
    table = Table(title="thread_pitch")
    for heading in ("what", "samples", "ms", "million samples/s", "times copying", "into memory at hand"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    for figure in found:
        table.add_row(figure.what, f"{figure.samples:,}", f"{1e3 * figure.seconds:.2f}", f"{figure.rate:.1f}",
                      f"{figure.rate / found[0].rate:.3g}", f"{figure.rate / found[1].rate:.3g}")
    Console(width=120).print(table)


if __name__ == "__main__":
    main()
