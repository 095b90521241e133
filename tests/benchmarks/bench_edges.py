"""Whether the stated 95 % interval of crossings by edges holds the truth, over synthetic logs of held-out seeds.

    python -m tests.benchmarks.bench_edges [logs] [first seed]

The estimator was tuned on seeds below 1000; the default takes 1000 logs from seed 1,000,000 on. Printed are the shares
of the turns whose true pitch lies within P(n) +- 1.96 u: of all turns, and of the logs parted by counts per turn.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.synthetic_logs import log_with_truth
from threadpitch.pitch import edge_pitch_table, pitch_table
from threadpitch.trace import TURN, FloatArray

LOGS = 1000
FIRST_SEED = 1_000_000
COVERAGE = 1.96  # standard uncertainties on either side


def errors(seed: int) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """(counts per turn; error, standard uncertainty and error of linear crossings of every turn, (turns,) m)."""
    trace, truth = log_with_truth(seed)
    table = edge_pitch_table(trace)
    assert table.uncertainty is not None
    known = ~np.isnan(table.pitch[0])
    size = known.size
    linear = (pitch_table(trace).pitch[0] - truth[:size])[known]
    return (TURN / trace.resolution, table.pitch[0, known] - truth[:size][known], table.uncertainty[0, known], linear)


def main() -> None:
    """Prints the table."""
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else LOGS
    first = int(sys.argv[2]) if len(sys.argv) > 2 else FIRST_SEED
    found: dict[str, list[tuple[FloatArray, FloatArray, FloatArray]]] = defaultdict(list)
    for seed in range(first, first + logs):
        counts, *of_turns = errors(seed)
        for name in ("all", f"{counts:.0f} counts per turn"):
            found[name].append((of_turns[0], of_turns[1], of_turns[2]))
    table = Table(title=f"Crossings by edges, {logs} logs from seed {first}")
    for heading in ("logs", "turns", "within 1.96 u [%]", "error [um]", "error of linear crossings [um]"):
        table.add_column(heading, justify="right")
    for name in sorted(found, key=lambda name: (name != "all", len(name), name)):
        error, uncertainty, linear = (np.concatenate(parts) for parts in zip(*found[name], strict=True))
        inside = np.mean(np.abs(error) <= COVERAGE * uncertainty)
        table.add_row(name, str(error.size), f"{100.0 * inside:.1f}", *(
            f"{1e6 * np.sqrt(np.mean(values**2)):.3f}" for values in (error, linear)))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
