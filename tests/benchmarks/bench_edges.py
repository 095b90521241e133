"""Whether the stated 95 % interval of crossings by edges holds the truth, over synthetic logs of held-out seeds.

    python -m tests.benchmarks.bench_edges [logs] [first seed]

The estimator was written with seeds below 1,000,000; the default takes 4000 logs from seed 2,000,000 on. Printed are
the shares of the turns whose true pitch lies within P(n) +- 1.96 u: of all turns, and of the logs parted by each of the
conditions under which they were recorded; with the standard error of the share, which the number of logs gives.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.synthetic_logs import Conditions, log_with_truth
from threadpitch.pitch import edge_pitch_table, pitch_table
from threadpitch.trace import FloatArray

LOGS = 4000
FIRST_SEED = 2_000_000
COVERAGE = 1.96  # standard uncertainties on either side
PER_SAMPLE = (0.0, 0.25, 0.5, 0.7, 1.0, 2.0, 4.0, 16.0)  # counts per sample, where classes begin
PER_TURN = (60.0, 120.0, 240.0, 480.0)  # samples per turn, likewise


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of the turns of one log, (turns,) m."""

    conditions: Conditions
    error: FloatArray
    uncertainty: FloatArray
    linear: FloatArray  # error of linear crossings

    @property
    def inside(self) -> FloatArray:
        """1 where the interval holds the truth."""
        return (np.abs(self.error) <= COVERAGE * self.uncertainty).astype(np.float64)


def outcome(seed: int) -> Outcome:
    """Of the log of a seed."""
    log = log_with_truth(seed)
    table = edge_pitch_table(log.trace)
    assert table.uncertainty is not None
    known = ~np.isnan(table.pitch[0])
    truth = log.pitch[: known.size]
    linear = (pitch_table(log.trace).pitch[0] - truth)[known]
    return Outcome(log.conditions, (table.pitch[0] - truth)[known], table.uncertainty[0, known], linear)


def share(outcomes: list[Outcome]) -> tuple[float, float]:
    """Share of the turns within the interval, and its standard error; the turns of a log go together."""
    inside, turns = (np.array(values) for values in zip(*((one.inside.sum(), one.error.size) for one in outcomes),
                                                       strict=True))
    mean = inside.sum() / turns.sum()
    return float(mean), float(np.sqrt(np.sum((inside - mean * turns) ** 2)) / turns.sum())


def classes(conditions: Conditions) -> Iterator[tuple[str, float]]:
    """Name and value (of a range: where it begins) of all classes to which a log belongs."""
    yield "all", 0.0
    yield "counts per turn:", conditions.counts_per_turn
    yield "counts per sample, from", max(begin for begin in PER_SAMPLE if begin <= conditions.counts_per_sample)
    yield "samples per turn, from", max(begin for begin in PER_TURN if begin <= conditions.samples_per_turn)
    yield "turns in the log:", conditions.turns
    yield "jitter, samples:", conditions.jitter
    yield "lateness, samples:", conditions.lateness
    yield "ripple, turns:", conditions.ripple
    yield "ramp of the speed, share:", conditions.ramp
    yield "noise, um:", 1e6 * conditions.noise
    yield "position count, um:", 1e6 * conditions.position_count
    yield "count known (1) or found:", conditions.count_given


def by_class(outcomes: list[Outcome]) -> dict[tuple[str, float], list[Outcome]]:
    """The outcomes of every class, in the order of the classes, rising."""
    found: dict[tuple[str, float], list[Outcome]] = {}
    for one in outcomes:
        for name in classes(one.conditions):
            found.setdefault(name, []).append(one)
    names = list(dict.fromkeys(name for name, _ in found))
    return {key: found[key] for key in sorted(found, key=lambda key: (names.index(key[0]), key[1]))}


def main() -> None:
    """Prints the table."""
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else LOGS
    first = int(sys.argv[2]) if len(sys.argv) > 2 else FIRST_SEED
    table = Table(title=f"Crossings by edges, {logs} logs from seed {first}")
    for heading in ("logs", "number", "turns", "within 1.96 u [%]", "+-", "error [um]", "u [um]", "linear [um]"):
        table.add_column(heading, justify="left" if heading == "logs" else "right")
    for (name, value), of_class in by_class([outcome(seed) for seed in range(first, first + logs)]).items():
        inside, deviation = share(of_class)
        roots = [1e6 * np.sqrt(np.mean(np.concatenate(values) ** 2)) for values in zip(
            *((one.error, one.uncertainty, one.linear) for one in of_class), strict=True)]
        label = name if name == "all" else f"{name} {value:g}"
        table.add_row(label, str(len(of_class)), str(sum(one.error.size for one in of_class)),
                      f"{100.0 * inside:.1f}", f"{100.0 * deviation:.1f}", *(f"{root:.3f}" for root in roots))
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
