"""Speed of studies: rows per second against what bare runs allow, one and two workers, and what FMPy's ways take.

    python -m tests.benchmarks.bench_study [rows]          default 400
    python -m tests.benchmarks.bench_study memory [runs]   default 10000

A row is a threading pass of 4 s with seven native FMUs, 4000 steps of 1 ms. The bare time is that of the compiled
master's loop alone, with everything loaded, initialised and nothing looked at. Bare runs, one and two workers take
turns, because other work on the machine comes and goes; the best of each is taken. On a busy machine the time of the
clock says little, that of the processors holds. All rates are without the start of the workers.
"""

from __future__ import annotations

import functools
import math
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

import dask.bag
import fmpy
import psutil  # type: ignore[import-untyped] # it ships no types
from rich.console import Console
from rich.table import Table

from tests.benchmarks.bench_killed_workers import own_workers
from tests.importer_run import run_fmpy
from threadpitch import cosim, lathe
from threadpitch.cosim import master
from threadpitch.cosim.network import Network
from threadpitch.cosim.program import Program
from threadpitch.cosim.selection import Selection
from threadpitch.roles import Roles
from threadpitch.studies import study_of
from threadpitch.studies.cluster import connected
from threadpitch.studies.evaluation import Evaluator
from threadpitch.studies.execution import OnDask, sent
from threadpitch.studies.parcel import Parcel
from threadpitch.system_archive import FmuKind, build_system

STOP, STEP = 4.0, 1e-3
CORES = 2
ROUNDS = 2
WARM = 0.25  # part of the rows that is computed before the clock starts
OTHERS = 4  # rows that FMPy's ways compute


def definition(rows: int) -> dict[str, Any]:
    """A study over three parameters; nothing of a run's beginning is shared."""
    return {
        "study": {"design": "latin_hypercube", "samples": rows, "seed": 1, "stop_time": STOP, "flavor": "native"},
        "parameters": {"z_drive.position_gain": {"from": 30, "to": 80}, "spindle.inertia": {"from": 0.1, "to": 0.2},
                       "controller.commanded_speed": {"from": "300rpm", "to": "600rpm"}},
        "outcomes": {"worst": "actual.max_deviation", "lag": "max(abs(z_drive.following_error))"},
    }


@contextmanager
def bare_run() -> Iterator[Callable[[], Speed]]:
    """A call that runs the compiled loop over all steps, and returns what that took."""
    with ExitStack() as stack:
        system = stack.enter_context(cosim.read_system(
            lathe.find_system(lathe.DEFAULT_SYSTEM), locate=functools.partial(lathe.locate_fmu, "native")))
        plan = stack.enter_context(cosim.prepare(system))
        schedule = cosim.choose_schedule(plan, stop_time=STOP, step_size=STEP)
        selection = Selection((), watch=Roles.of(plan).watch)
        recorder = selection.recorder(plan, schedule, selection.channels(plan), None)
        network = Network(stack.enter_context(cosim.instantiate(plan)), plan.links, recorder)
        program = Program(network)

        fresh = iter([True])

        def run() -> Speed:
            if not next(fresh, False):
                for node in network.nodes:
                    node.instance.reset()  # type: ignore[attr-defined] # they are loaded FMUs
            recorder.begin()
            master.initialize(network, schedule, plan.settings)
            began, computed = perf_counter(), process_time()
            program(network, schedule, range(schedule.steps))
            return Speed(perf_counter() - began, process_time() - computed)

        run()  # compiles
        yield run


class Speed(NamedTuple):
    """Seconds of a row: of the clock, and of all processors together, scheduler and client included."""

    clock: float
    processor: float


def processor_time() -> float:
    """Seconds that this process and its workers have computed."""
    times = [one.cpu_times() for one in own_workers()]
    workers: float = sum(one.user + one.system for one in times)
    return process_time() + workers


def speed(batches: Iterator[list[Any]], rows: int) -> Speed:
    """Of all rows behind the first part of them."""
    done, first, began, computed, now = 0, 0, 0.0, 0.0, Speed(0.0, 0.0)
    for batch in batches:
        done += len(batch)
        if not first and done >= WARM * rows:
            first, began, computed = done, perf_counter(), processor_time()
        elif done == rows:
            now = Speed(perf_counter() - began, processor_time() - computed)
    return Speed(now.clock / (rows - first), now.processor / (rows - first))


def simulate_each(fmus: list[str], gain: float) -> float:
    """FMPy's simulate_fmu of every FMU by itself, unconnected: what a row of its Dask example does."""
    for fmu in fmus:
        values = {"position_gain": gain} if "FeedDrive" in fmu else {}
        result = fmpy.simulate_fmu(fmu, stop_time=STOP, output_interval=STEP, start_values=values)
    return float(result["time"][-1])


def simulate_whole(ssp: str, _: float) -> float:
    """FMPy's simulate_ssp of the whole lathe."""
    return float(run_fmpy(ssp, round(STOP / STEP))["nominal_pitch.pitch[1]"][-1])


def others(folder: Path) -> Iterator[tuple[str, float]]:
    """Seconds of a row by the ways of FMPy, with two processes."""
    ssp = build_system(lathe.DEFAULT_SYSTEM, folder, FmuKind("native"))
    names = ["SpindleDrive", "ThreadingController", "FeedDrive", "FeedDrive", "ThreadCutting", "PitchCalculator",
             "PitchCalculator"]
    fmus = [str(lathe.locate_fmu("native", f"{name}.fmu", folder)) for name in names]
    gains = [40.0 + number for number in range(OTHERS)]
    with ProcessPoolExecutor(CORES) as pool:
        bag = dask.bag.from_sequence(gains, npartitions=OTHERS).map(functools.partial(simulate_each, fmus))
        whole = functools.partial(simulate_whole, str(ssp))
        ways: dict[str, Callable[[], Any]] = {
            "Dask bag of FMPy simulate_fmu, seven unconnected FMUs": functools.partial(
                bag.compute, scheduler="processes", pool=pool),
            "process pool of FMPy simulate_ssp": lambda: list(pool.map(whole, gains))}
        for name, compute in ways.items():
            compute()  # processes are started, modules imported
            began = perf_counter()
            compute()
            yield name, (perf_counter() - began) / OTHERS


def measured(rows: int) -> tuple[Speed, dict[int, Speed]]:
    """The best of bare runs, and of studies by the number of workers (0: this process)."""
    study = study_of(definition(rows))
    found: dict[int, Speed] = {}
    with Evaluator(study) as evaluator, bare_run() as bare:
        parcel = Parcel.of(evaluator)
        best = Speed(math.inf, math.inf)
        for _ in range(ROUNDS):
            best = _better(best, *(bare() for _ in range(10)))
            for workers in (0, 1, 2):
                if workers == 0:
                    batches: Iterator[list[Any]] = ([one] for one in evaluator.outcomes(range(rows // 2)))
                    now = speed(batches, rows // 2)
                else:
                    with connected(workers, None, {}) as client, sent(client, parcel) as name:
                        now = speed(OnDask(client, name).outcomes(range(rows)), rows)
                found[workers] = _better(now, found.get(workers, now))
            best = _better(best, *(bare() for _ in range(10)))
    return best, found


def _better(*speeds: Speed) -> Speed:
    return Speed(*(min(times) for times in zip(*speeds, strict=True)))


def memory(runs: int) -> None:
    """Print the memory of two workers, and of this process with client and scheduler, after more and more runs."""
    study = study_of(definition(runs))
    with Evaluator(study) as evaluator:
        marks = iter([*(count for count in (20, 100, 300) if count < runs), *range(1000, runs, 1000), runs])
        done, mark = 0, next(marks)
        with connected(CORES, None, {}) as client, sent(client, Parcel.of(evaluator)) as name:
            for outcomes in OnDask(client, name).outcomes(range(runs)):
                assert all(one.status == "ok" for one in outcomes), [one.reason for one in outcomes]
                done += len(outcomes)
                if done >= mark:
                    workers = "  ".join(f"{one.memory_info().rss / 2**20:.1f}" for one in own_workers())
                    print(f"{done:6d} runs: workers {workers} MB, this process "
                          f"{psutil.Process().memory_info().rss / 2**20:.1f} MB", flush=True)
                    mark = next((count for count in marks if count > done), runs)


def main() -> None:
    """Print the figures."""
    if sys.argv[1:2] == ["memory"]:
        memory(int(sys.argv[2]) if sys.argv[2:] else 10_000)
        return
    rows = int(sys.argv[1]) if sys.argv[1:] else 400
    bare, found = measured(rows)
    table = Table("what", "clock\nms per row", "processors\nms per row", "bare / clock\nper core", "bare / processors")
    table.add_row("bare loop, one core", f"{bare.clock * 1e3:.1f}", f"{bare.processor * 1e3:.1f}", "", "")
    for workers, one in found.items():
        table.add_row(f"study, {workers} workers" if workers else "study, this process", f"{one.clock * 1e3:.1f}",
                      f"{one.processor * 1e3:.1f}", f"{bare.clock / one.clock / max(1, workers):.2f}",
                      f"{bare.processor / one.processor:.2f}")
    with tempfile.TemporaryDirectory() as folder:
        for name, seconds in others(Path(folder)):
            table.add_row(name, f"{seconds * 1e3:.0f}", "", f"{seconds / found[2].clock:.0f} times slower", "")
    Console(width=130).print(table)
    print(f"2 workers against 1: {found[1].clock / found[2].clock:.2f} times the rows")


if __name__ == "__main__":
    main()
