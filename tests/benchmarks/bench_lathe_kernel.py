"""The lathe in the kernel, all variables recorded, against the sum of its FMUs' own bare loops.

    python -m tests.benchmarks.bench_lathe_kernel

A bare loop is compiled code that does nothing but set one FMU's inputs, as they were recorded in a run of the lathe,
and call its doStep, so that every FMU does the work that it does in the lathe. All take turns, round by round; the
shortest of each is taken, and processor time, because other work on the machine only makes a run slower.
"""

from __future__ import annotations

import functools
from time import thread_time
from typing import Any

import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from threadpitch import cosim, lathe
from threadpitch.cosim import master
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.calls import call_four, call_step2
from threadpitch.cosim.check import Plan
from threadpitch.cosim.engine import choose_engine
from threadpitch.cosim.intermediate import function_address
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.result import Result
from threadpitch.cosim.selection import choose_channels
from threadpitch.cosim.simulation import choose_schedule, instantiate

ROUNDS = 15
FAMILIES = ("fmi2Real", "fmi2Integer", "fmi2Boolean")


@numba.njit
def bare_loop(component: int, do_step: int, sets: Any, steps: int, step_size: float) -> int:
    """Per step: for every row of ``sets`` (function, references, count, first value, bytes of a row), then doStep."""
    worst = 0
    for n in range(steps):
        for row in range(sets.shape[0]):
            if sets[row, 2] > 0:
                call_four(sets[row, 0], component, sets[row, 1], sets[row, 2],
                          sets[row, 3] + np.uint64(n) * sets[row, 4])
        worst = max(worst, call_step2(do_step, component, n * step_size, step_size, np.int32(1)))
    return worst


def run(plan: Plan, record: tuple[str, ...]) -> tuple[float, Result]:
    """Seconds of the kernel's steps, and what it recorded."""
    schedule = choose_schedule(plan)
    with instantiate(plan) as instances:
        network = Network(instances, plan.links, Recorder(choose_channels(plan, record), schedule))
        algorithm = choose_engine(network, "kernel")
        master.initialize(network, schedule, plan.settings)
        begin = thread_time()
        master.run(network, schedule, algorithm)
        return thread_time() - begin, Result(network.recorder)


def bare(plan: Plan, recorded: Result) -> dict[str, float]:
    """Seconds by component: steps with the inputs of the run."""
    schedule, seconds = choose_schedule(plan), {}
    with instantiate(plan) as instances:
        network = Network(instances, plan.links, Recorder([], schedule))
        master.initialize(network, schedule, plan.settings)
        for instance in instances:
            links = [link for link in plan.links if link.target_component == instance.name]
            kept, sets = [], np.zeros((len(FAMILIES), 5), np.uint64)
            for row, c_type in enumerate(FAMILIES):
                targets = [link.target for link in links if link.target.c_type == c_type]
                values = np.zeros((schedule.steps + 1, len(targets)), C_TYPES[c_type].dtype)
                for place, target in enumerate(targets):
                    values[:, place] = recorded[f"{instance.name}.{target.name}"]
                references = np.array([target.reference for target in targets], np.uint32)
                kept += [values, references]
                setter = function_address(getattr(instance.dll, C_TYPES[c_type].setter))  # type: ignore[attr-defined]
                first = values.ctypes.data + values.strides[0]  # Gauss-Seidel: most inputs are those at the end
                sets[row] = setter, references.ctypes.data, references.size, first, values.strides[0]
            address = function_address(instance.dll.fmi2DoStep)  # type: ignore[attr-defined]
            component = np.uint64(instance.component)  # type: ignore[attr-defined]
            begin = thread_time()
            assert bare_loop(component, np.uint64(address), sets, schedule.steps, schedule.step_size) < 2
            seconds[instance.name] = thread_time() - begin
    return seconds


def main() -> None:
    """Prints the table."""
    locate = functools.partial(lathe.locate_fmu, "native")
    with cosim.read_system(lathe.find_system(lathe.DEFAULT_SYSTEM), locate=locate) as system, \
            cosim.prepare(system) as plan:
        _, recorded = run(plan, ("*",))
        bare(plan, recorded)  # compiles
        whole, without, parts = [], [], []
        for _ in range(ROUNDS):
            whole.append(run(plan, ("*",))[0])
            without.append(run(plan, ("nominal_pitch.pitch[1]",))[0])
            parts.append(bare(plan, recorded))
        steps = choose_schedule(plan).steps
    table = Table("what", "us per step", title="The lathe, native FMUs, steps of 1 ms")
    best = {name: min(part[name] for part in parts) for name in parts[0]}
    for name, seconds in best.items():
        table.add_row(f"bare loop of {name}", f"{seconds / steps * 1e6:.2f}")
    total = sum(best.values())
    for what, seconds in (("sum of the bare loops", total), (f"kernel, all {len(recorded)} variables", min(whole)),
                          ("kernel, one variable", min(without))):
        table.add_row(what, f"{seconds / steps * 1e6:.2f}")
    console = Console(width=100)
    console.print(table)
    console.print(f"kernel with all variables: {min(whole) / total:.2f} times the sum of the bare loops")


if __name__ == "__main__":
    main()
