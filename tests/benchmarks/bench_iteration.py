"""How many sweeps a loop of linear components takes to rest: 10,000 random contractions of each size.

    python -m tests.benchmarks.bench_iteration

x = A x + b with |A| = 0.9, to a tolerance of 1e-12; two sweeps are taken before the differences between sweeps count.
Repetition alone takes 260 sweeps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from threadpitch.cosim.iteration import Iterates, Loop, add_column, begin_iteration, feed, fit, settled
from threadpitch.cosim.method import Method

CASES = 10_000
SIZES = (1, 2, 3, 5, 8)
TOLERANCE = 1e-12
FACTOR = 0.9
MOST_SWEEPS = 400


def repeated(slope: NDArray[np.float64], offset: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """What sweeps of x = slope x + offset come to, and how many; one more than the most where there is no rest."""
    count = offset.size
    iterates, loop = Iterates.of(list(range(count)), []), Loop(0, 1, 0, count, 0, 0)
    reals, columns = np.ones(count), 0
    begin_iteration(iterates, loop, reals, np.zeros(0, np.uint8))
    for sweep in range(1, MOST_SWEEPS + 1):
        reals[:] = slope @ reals + offset
        if settled(iterates, loop, reals, TOLERANCE) and sweep > 1:
            return reals, sweep
        columns = add_column(iterates, loop, reals, sweep, columns)
        feed(iterates, loop, reals, fit(iterates, loop, sweep, columns))
    return reals, MOST_SWEEPS + 1


def sweeps_of_contractions(size: int, cases: int) -> list[int]:
    """The sweeps of random contractions of so many values.

    Raises:
        AssertionError: what a loop rests at is not its fixed point.
    """
    generator = np.random.default_rng(size)
    found = []
    for _ in range(cases):
        slope = generator.uniform(-0.5, 0.5, (size, size))
        slope *= FACTOR / float(np.linalg.norm(slope, 2))
        offset = generator.uniform(-9.0, 9.0, size)
        reals, sweeps = repeated(slope, offset)
        if sweeps <= MOST_SWEEPS:
            exact = np.linalg.solve(np.eye(size) - slope, offset)
            assert np.allclose(reals, exact, rtol=1e-9, atol=1e-9 * float(np.abs(exact).max())), (slope, offset)
        found.append(sweeps)
    return found


def main() -> None:
    """Prints the table."""
    default = Method().iterations
    table = Table("values fed back", "contractions", "without rest", f"more than {default} sweeps", "sweeps, mean",
                  "most", title=f"Contractions by {FACTOR}, tolerance {TOLERANCE:g}")
    for size in SIZES:
        found = np.array(sweeps_of_contractions(size, CASES))
        table.add_row(f"{size}", f"{CASES:,}", f"{(found > MOST_SWEEPS).sum()}", f"{(found > default).sum()}",
                      f"{found.mean():.2f}", f"{found.max()}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
