"""How often the judgement is right: threads with drawn parameters, faults, severities and noise, cause known.

    python -m tests.benchmarks.bench_judgement [--threads N] [--machines N] [--development]

The threads come from closed formulae (``drawn_threads``), severities from 5 to 50 measuring uncertainties; a third as
many have 1 to 5. More are cut by the simulated lathe (``simulated_threads``). Thresholds were set on the development
seeds; what is printed by default comes from held-out ones. The seed's sign rule and plain correlation judge the same
threads; their thresholds are the best ones for the threads that they are then tried on, which flatters them. A quarter
of the drawn threads with a fault has jitter in the nominal pitches, of 1 to 5 uncertainties at its largest.

"Wrong single cause": control or mechanical is named, and the other one, or neither, is the cause. "Half": one of two
causes is named.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from multiprocessing import Pool
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

import threadpitch as tp
from tests.benchmarks.drawn_threads import Thread, drawn
from tests.benchmarks.simulated_threads import offered, threads

CAUSES = ("control", "mechanical", "both", "none")
VERDICTS = (*CAUSES, "undetermined")
DEVELOPMENT, HELD_OUT = 0, 1_000_000  # first seeds
CLEAR, FAINT = (5.0, 50.0), (1.0, 5.0)  # severities over the measuring uncertainty
NOTICEABLE = 1.5  # root mean square over the uncertainty from which the simple rules see a fluctuation at all

Judged = tuple[str, str]  # (true cause, verdict)


@dataclass(frozen=True)
class Score:
    """Shares of the threads of one set."""

    right: float
    wrong_single: float
    half: float
    undetermined: float


@dataclass(frozen=True)
class Trial:
    """One thread: what it is and what each rule needs of it."""

    fault: str
    cause: str
    verdict: str
    size: float  # root mean square of the measured deviation over the uncertainty
    signs: float  # share of turns on the same side
    correlation: float


def try_thread(thread: Thread) -> Trial:
    """The verdict on a thread, and what the simple rules look at."""
    verdict = tp.judge(thread.nominal, thread.measured, target=thread.machine.lead, uncertainty=thread.uncertainty,
                       screw_lead=thread.machine.screw_lead)
    found = verdict.evidence
    return Trial(thread.fault, thread.cause, verdict.cause, found.fluctuation / thread.uncertainty,
                 found.sign_agreement or 0.0, found.correlation or 0.0)


def try_seed(drawing: tuple[int, float, float]) -> Trial:
    """The thread of a seed, judged."""
    return try_thread(drawn(*drawing))


def score(judged: Iterable[Judged]) -> Score:
    """What part is right, wrong, half right and undetermined."""
    count = Counter(judged)
    whole = max(sum(count.values()), 1)
    wrong = sum(number for (cause, verdict), number in count.items()
                if verdict in ("control", "mechanical") and cause not in (verdict, "both"))
    half = sum(number for (cause, verdict), number in count.items()
               if cause == "both" and verdict in ("control", "mechanical"))
    return Score(sum(count[cause, cause] for cause in CAUSES) / whole, wrong / whole, half / whole,
                 sum(number for (_, verdict), number in count.items() if verdict == "undetermined") / whole)


def simple_rule(trials: Sequence[Trial], look: Callable[[Trial], float]) -> list[Judged]:
    """None below a noticeable size, else control or mechanical by the threshold that suits these threads best."""
    def verdicts(threshold: float) -> list[Judged]:
        return [(one.cause, "none" if one.size < NOTICEABLE else
                 "control" if look(one) >= threshold else "mechanical") for one in trials]

    return max((verdicts(float(threshold)) for threshold in np.linspace(0.0, 1.0, 41)),
               key=lambda judged: score(judged).right)


def show(console: Console, title: str, trials: Sequence[Trial]) -> None:
    """The confusion matrix of the judgement, and the shares of all rules."""
    judged = [(one.cause, one.verdict) for one in trials]
    count = Counter(judged)
    matrix = Table("cause \\ verdict", *VERDICTS, title=f"{title}: {len(trials)} threads")
    for cause in CAUSES:
        matrix.add_row(cause, *(str(count[cause, verdict]) for verdict in VERDICTS))
    console.print(matrix)
    shares = Table("rule", "right", "wrong single cause", "half", "undetermined")
    rules = {"judge": judged, "sign rule": simple_rule(trials, lambda one: one.signs),
             "correlation": simple_rule(trials, lambda one: one.correlation)}
    for name, result in rules.items():
        found = score(result)
        shares.add_row(name, *(f"{100.0 * share:.2f} %" for share in
                               (found.right, found.wrong_single, found.half, found.undetermined)))
    console.print(shares)
    missed = Counter(f"{one.fault}: {one.verdict}" for one in trials if one.verdict != one.cause)
    console.print("most often missed: " + "; ".join(f"{what} ({number})" for what, number in missed.most_common(8)))


def main() -> None:
    """Judge the threads and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=1500, help="threads whose fault is clear")
    parser.add_argument("--machines", type=int, default=10, help="machines on which each fault is simulated")
    parser.add_argument("--development", action="store_true", help="the seeds on which the thresholds were set")
    options = parser.parse_args()
    first = DEVELOPMENT if options.development else HELD_OUT
    console = Console(width=110)
    begin = perf_counter()
    with Pool() as pool:
        for title, severities, number in (("fault at least 5 times the uncertainty", CLEAR, options.threads),
                                          ("fault 1 to 5 times the uncertainty", FAINT, options.threads // 3)):
            seeds = ((first + seed, *severities) for seed in range(number))
            show(console, title, pool.map(try_seed, seeds, chunksize=25))
        if options.machines > 0:
            cut = pool.map(try_thread, threads(first, options.machines), chunksize=5)
            show(console, "cut by the simulated lathe", cut)
            console.print(f"{offered(options.machines) - len(cut)} of {offered(options.machines)} left out: "
                          "cause in doubt, or an uncertainty too small to be real")
    console.print(f"{'development' if options.development else 'held-out'} seeds, {perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
