"""How often the judgement is right: threads with drawn parameters, faults, severities and noise, cause known.

    python -m tests.benchmarks.bench_judgement [--threads N] [--cut N] [--development] [--store FILE]

Some threads come from closed formulae (``drawn_threads``), some are cut by the simulated lathe, each in a run of its
own through the real FMUs (``cut_threads``). Severities go from 5 to 50 measuring uncertainties; a third as many have 1
to 5. Thresholds were set on the development seeds; what is printed by default comes from held-out ones. The seed's sign
rule and plain correlation judge the same threads; their thresholds are the best ones for the threads that they are then
tried on, which flatters them. A quarter of the drawn threads with a fault has jitter in the nominal pitches, of 1 to 5
uncertainties at its largest.

"Wrong single cause": control or mechanical is named, and the other one, or neither, is the cause. "Half": one of two
causes is named. "None of something": a fault that is there is taken for noise. "Wrong of any kind" is all that is
neither right nor undetermined. Below 5 uncertainties the threads are judged a second time by one who says that all from
one uncertainty on matters (``negligible``), and it is counted how often a cause that was not named is within the bound
that the verdict tells for it.
"""

from __future__ import annotations

import argparse
import functools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from multiprocessing import Pool
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table

import threadpitch as tp
from tests.benchmarks.cut_threads import cut_thread, opened_lathe
from tests.benchmarks.drawn_threads import Thread, drawn
from threadpitch.cosim.check import Plan

CAUSES = ("control", "mechanical", "both", "none")
VERDICTS = (*CAUSES, "undetermined")
DEVELOPMENT, HELD_OUT = 0, 9_000_000  # first seeds; those from 2,000,000 and 7,000,000 on are used up
CLEAR, FAINT = (5.0, 50.0), (1.0, 5.0)  # severities over the measuring uncertainty
CHUNK = 50  # threads that are cut before it is looked whether they are enough
NOTICEABLE = 1.5  # root mean square over the uncertainty from which the simple rules see a fluctuation at all

Judged = tuple[str, str]  # (true cause, verdict)


@dataclass(frozen=True)
class Score:
    """Shares of the threads of one set."""

    right: float
    wrong_single: float
    half: float
    overlooked: float
    undetermined: float

    @property
    def wrong(self) -> float:
        """Neither right nor undetermined."""
        return 1.0 - self.right - self.undetermined


@dataclass(frozen=True)
class Trial:
    """One thread: what it is and what each rule needs of it."""

    fault: str
    cause: str
    verdict: str
    size: float  # root mean square of the measured deviation over the uncertainty
    signs: float  # share of turns on the same side
    correlation: float
    besides: tuple[str, ...] = ()  # causes that are too small to be asked for
    strict: str = ""  # the verdict where a deviation of one uncertainty matters
    bounded: tuple[bool, ...] = ()  # of each cause that is there and not named: within the bound that is told

    @property
    def allowed(self) -> set[str]:
        """Verdicts that are right: the cause, with or without what is besides."""
        parts = {"both": {"control", "mechanical"}, "none": set()}.get(self.cause, {self.cause})
        more = parts | set(self.besides)
        return {self.cause, "both" if len(more) == 2 else next(iter(more), "none")}


def try_thread(thread: Thread, besides: tuple[str, ...] = ()) -> Trial:
    """The verdict on a thread, and what the simple rules look at."""
    judge = functools.partial(tp.judge, thread.nominal, thread.measured, target=thread.machine.lead,
                              uncertainty=thread.uncertainty, screw_lead=thread.machine.screw_lead)
    verdict = judge()
    found = verdict.evidence
    strict = judge(negligible=thread.uncertainty).cause if thread.severity < FAINT[1] else verdict.cause
    absent = {"none": CAUSES[:2], "control": ("mechanical",), "mechanical": ("control",)}.get(verdict.cause, ())
    return Trial(thread.fault, thread.cause, verdict.cause, found.fluctuation / thread.uncertainty,
                 found.sign_agreement or 0.0, found.correlation or 0.0, besides, strict,
                 tuple(thread.sizes[cause] <= found.bound for cause in absent if cause in thread.sizes))


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
    overlooked = sum(number for (cause, verdict), number in count.items() if verdict == "none" != cause)
    return Score(sum(count[cause, cause] for cause in CAUSES) / whole, wrong / whole, half / whole, overlooked / whole,
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
    clear = [one for one in trials if not one.besides]
    judged = [(one.cause, one.verdict) for one in clear]
    count = Counter(judged)
    matrix = Table("cause \\ verdict", *VERDICTS, title=f"{title}: {len(clear)} threads")
    for cause in CAUSES:
        matrix.add_row(cause, *(str(count[cause, verdict]) for verdict in VERDICTS))
    console.print(matrix)
    shares = Table("rule", "right", "wrong single cause", "half", "none of something", "undetermined",
                   "wrong of any kind")
    strict = [(one.cause, one.strict) for one in clear]
    rules = {"judge": judged}
    if any(one.strict != one.verdict for one in clear if one.cause != "none"):  # faint ones
        rules["judge, 1 u matters"] = strict
    rules |= {"sign rule": simple_rule(clear, lambda one: one.signs),
              "correlation": simple_rule(clear, lambda one: one.correlation)}
    for name, result in rules.items():
        found = score(result)
        shares.add_row(name, *(f"{100.0 * share:.2f} %" for share in
                               (found.right, found.wrong_single, found.half, found.overlooked, found.undetermined,
                                found.wrong)))
    console.print(shares)
    missed = Counter(f"{one.fault}: {one.verdict}" for one in clear if one.verdict != one.cause)
    console.print("most often missed: " + "; ".join(f"{what} ({number})" for what, number in missed.most_common(8)))
    bounded = [one for trial in clear for one in trial.bounded]
    console.print(f"of {len(bounded)} causes that are there and not named, {sum(bounded)} are within the bound told")
    show_besides(console, [one for one in trials if one.besides])


def show_besides(console: Console, trials: Sequence[Trial]) -> None:
    """Threads with a cause besides that is too small to be asked for: it may be found, found not, or left open."""
    if trials:
        allowed = [one.verdict in one.allowed for one in trials]
        open_ = [one.verdict == "undetermined" for one in trials]
        console.print(f"{len(trials)} more have a smaller cause besides, which may be named or not: right "
                      f"{sum(allowed)}, undetermined {sum(open_)}, wrong {len(trials) - sum(allowed) - sum(open_)}")


class Store:
    """Verdicts that are kept in a file of JSON lines, by set and seed, so that a benchmark that was ended goes on."""

    def __init__(self, path: Path | None) -> None:
        self.path = path
        self.known: dict[tuple[str, int], Trial | None] = {}
        for line in path.read_text(encoding="utf-8").splitlines() if path is not None and path.is_file() else ():
            found = json.loads(line)
            self.known[found["set"], found["seed"]] = None if found["trial"] is None else Trial(**found["trial"])

    def keep(self, name: str, seed: int, trial: Trial | None) -> None:
        """One more line."""
        self.known[name, seed] = trial
        if self.path is not None:
            line = {"set": name, "seed": seed, "trial": None if trial is None else asdict(trial)}
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


_plan: list[Plan] = []  # of a process of the pool: the lathe, opened once


def open_for_the_process(stack: ExitStack) -> None:
    """What a process of the pool begins with."""
    _plan.append(stack.enter_context(opened_lathe()))


def try_cut(drawing: tuple[int, float, float]) -> Trial | None:
    """The thread that the lathe cuts by this seed, judged; None where it is left out."""
    found = cut_thread(_plan[-1], *drawing)
    return None if found is None else try_thread(found.thread, tuple(sorted(found.besides)))


def cut_trials(name: str, wanted: int, drawing: tuple[int, float, float], store: Store) -> list[Trial]:
    """So many threads without a cause besides, in the order of their seeds, and those with one among them."""
    first, least, most = drawing
    trials: list[Trial] = []
    left_out = 0
    with ExitStack() as stack:
        open_for_the_process(stack)  # builds the FMUs and compiles the kernel, once for all
        if (name, first) not in store.known:
            store.keep(name, first, try_cut((first, least, most)))
        pool = stack.enter_context(Pool(initializer=open_for_the_process, initargs=(ExitStack(),)))
        for begin in range(first, first + 50 * wanted, CHUNK):
            seeds = range(begin, begin + CHUNK)
            new = [seed for seed in seeds if (name, seed) not in store.known]
            for seed, trial in zip(new, pool.imap(try_cut, ((seed, least, most) for seed in new)), strict=True):
                store.keep(name, seed, trial)
            for seed in seeds:
                found = store.known[name, seed]
                left_out += found is None
                trials += [] if found is None else [found]
                if sum(not one.besides for one in trials) == wanted:
                    print(f"{name}: {seed - first + 1} machines, {left_out} left out: fault smaller than can be "
                          "measured, or no thread")
                    return trials
    raise SystemExit(f"{name}: too few of {50 * wanted} machines cut a thread")


def main() -> None:
    """Judge the threads and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=1500, help="threads from formulae whose fault is clear")
    parser.add_argument("--cut", type=int, default=1000, help="threads that the lathe cuts whose fault is clear")
    parser.add_argument("--development", action="store_true", help="the seeds on which the thresholds were set")
    parser.add_argument("--store", type=Path, help="file of JSON lines with what was judged: a benchmark that is begun "
                                                   "again goes on behind it")
    options = parser.parse_args()
    first = DEVELOPMENT if options.development else HELD_OUT
    console = Console(width=120)
    begin = perf_counter()
    for title, severities, part in (("fault at least 5 times the uncertainty", CLEAR, 1),
                                    ("fault 1 to 5 times the uncertainty", FAINT, 3)):
        if options.threads > 0:
            with Pool() as pool:
                seeds = ((first + seed, *severities) for seed in range(options.threads // part))
                show(console, f"drawn, {title}", pool.map(try_seed, seeds, chunksize=25))
        if options.cut > 0:
            show(console, f"cut by the lathe, {title}",
                 cut_trials(f"cut, {title}", options.cut // part, (first, *severities), Store(options.store)))
    console.print(f"{'development' if options.development else 'held-out'} seeds, {perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
