"""``threadpitch run --program``: the threads of an NC program, cut by the simulated lathe."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from threadpitch import cycles, lathe
from threadpitch.cli.outcome import Done, save
from threadpitch.cli.printing import remark
from threadpitch.cosim.values import Given
from threadpitch.measuring import MeasuringPlan
from threadpitch.program_parameters import operations

# (folder, component.variable -> value of the program's words, stop time in s that is enough) -> what it leaves
Simulate: TypeAlias = Callable[[Path, Mapping[str, Given], float], lathe.Simulation]


def run_program(program: Path, setup: cycles.Setup, simulate: Simulate, *, output: Path,
                plan: MeasuringPlan | None) -> list[Done]:
    """Cut the operations of a program one after the other; several go into folders of their own in ``output``.

    Passes have the numbers of the program.

    Raises:
        CycleError, OperationError: what the control would refuse, and what the simulated one cannot cut.
    """
    result = cycles.interpret(cycles.read_program_file(program), setup)
    for notice in result.notices:
        remark(f"note: {notice}")
    steps = operations(result)
    final = cycles.final_flank(result.passes)
    done = []
    for number, step in enumerate(steps, start=1):
        folder = output if len(steps) == 1 else output / f"operation-{number}"
        simulation = simulate(folder, step.parameters, step.stop_time).numbered(
            [one.number for one in step.passes], final)
        done.append(save(simulation, folder, plan))
    return done
