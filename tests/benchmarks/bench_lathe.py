"""Speed of the default run: real-time factor, and where a step's time goes.

    python -m tests.benchmarks.bench_lathe

One run is timed whole; in a second one each component's doStep is timed, in a third everything but doStep. Each is
repeated and the best is taken, because other work on the machine only makes a run slower.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

from rich.console import Console
from rich.table import Table

from tests.benchmarks.bench_thread_pitch import figures as pitch_figures
from threadpitch import cosim, lathe
from threadpitch.cosim import master
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.selection import choose_channels
from threadpitch.cosim.simulation import choose_schedule, instantiate
from threadpitch.fmu import available_compiler

REPEATS = 3


@dataclass(frozen=True)
class Speed:
    """Seconds of one run: as a whole, per component's doStep, and the steps that it took."""

    whole: float
    simulated: float
    steps: int
    components: dict[str, float]

    @property
    def overhead(self) -> float:
        """What the master adds to the components' doStep: transfers, copies, recording."""
        return self.whole - sum(self.components.values())


def run_once(flavor: str, timed: bool) -> Speed:
    """The default system with all outputs recorded; with `timed`, doStep of every component is timed."""
    locate = functools.partial(lathe.locate_fmu, flavor)
    with cosim.read_system(lathe.find_system(lathe.DEFAULT_SYSTEM), locate=locate) as system, \
            cosim.prepare(system) as plan:
        schedule = choose_schedule(plan)
        recorder = Recorder(choose_channels(plan, ["outputs"]), schedule)
        with instantiate(plan) as instances:
            seconds = dict.fromkeys((instance.name for instance in instances), 0.0)
            if timed:
                for instance in instances:
                    instance.do_step = timing(instance.name, instance.do_step, seconds)  # type: ignore[method-assign]
            network = Network(instances, plan.links, recorder)
            master.initialize(network, schedule, plan.settings)
            begin = perf_counter()
            master.run(network, schedule)
            whole = perf_counter() - begin
    return Speed(whole, schedule.stop_time - schedule.start_time, schedule.steps, seconds)


def timing(name: str, do_step: Callable[[float, float], None], seconds: dict[str, float]) -> Callable[..., None]:
    """The call, with its time added to `seconds[name]`."""
    def timed(time: float, step_size: float) -> None:
        begin = perf_counter()
        do_step(time, step_size)
        seconds[name] += perf_counter() - begin

    return timed


def best(flavor: str) -> Speed:
    """Shortest times of several runs, whole and in parts."""
    whole = min((run_once(flavor, timed=False) for _ in range(REPEATS)), key=lambda speed: speed.whole)
    parts = [run_once(flavor, timed=True).components for _ in range(REPEATS)]
    components = {name: min(part[name] for part in parts) for name in parts[0]}
    return Speed(whole.whole, whole.simulated, whole.steps, components)


def figures(flavor: str) -> list[tuple[str, str]]:
    """Lines of the table: what, and its figure."""
    speed = best(flavor)
    lines = [(f"default run, {flavor} FMUs: real-time factor", f"{speed.simulated / speed.whole:.2f}")]
    lines += [(f"{flavor}: {name}.doStep", f"{seconds / speed.steps * 1e6:.1f} us per step")
              for name, seconds in speed.components.items()]
    overhead = speed.overhead / speed.steps * 1e6
    lines.append((f"{flavor}: master's transfers, copies, recording", f"{overhead:.1f} us per step"))
    return lines


def main() -> None:
    """Prints the table."""
    table = Table(title="threadpitch")
    table.add_column("what")
    table.add_column("figure", justify="right")
    for flavor in ("native", "python") if available_compiler() else ("python",):
        for line in figures(flavor):
            table.add_row(*line)
    for figure in pitch_figures(10_000_000):
        if figure.what.startswith("thread_pitch"):
            table.add_row(f"{figure.what}, {figure.samples:,} samples", f"{figure.rate:.0f} million samples/s")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
