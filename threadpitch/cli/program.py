"""``threadpitch run --program``: the threads of an NC program, cut by the simulated lathe."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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


@dataclass(frozen=True)
class Job:
    """A program, the machine as it finds it, and the file of the control's parameters, where there is one."""

    program: Path
    setup: cycles.Setup
    control: cycles.ParameterFile | None = None
    plan: MeasuringPlan | None = None  # how the threads are measured

    def interpreted(self) -> cycles.Interpretation:
        """The program executed; parameters that it rewrites are kept in the file."""
        setup = self.setup if self.control is None else replace(self.setup, parameters=self.control.read())
        result = cycles.interpret(cycles.read_program_file(self.program), setup)
        if self.control is None:
            return result
        return replace(result, parameters=self.control.rewrite(result.rewritten))


def run_program(job: Job, output: Path, simulate: Simulate) -> list[Done]:
    """Cut the operations of a program one after the other; several go into folders of their own in ``output``.

    Passes have the numbers of the program. The control's parameters 106 and 253 act where there is a file of them.

    Raises:
        CycleError, OperationError: what the control would refuse, and what the simulated one cannot cut.
    """
    result = job.interpreted()
    for notice in result.notices:
        remark(f"note: {notice}")
    across = [one.number for one in result.passes if any(path.long_axis == "x" for path in one.paths)]
    if across:
        remark(f"note: pass {across[0]} has its lead along X: P(n) below is the movement along Z, not its lead")
    steps = operations(result, control=None if job.control is None else result.parameters)
    hands = dict(zip((one.number for one in result.passes), cycles.hands(result.passes, result.moves), strict=True))
    final = cycles.final_flank(result.passes)
    done = []
    for number, step in enumerate(steps, start=1):
        folder = output if len(steps) == 1 else output / f"operation-{number}"
        numbers = [one.number for one in step.passes]
        simulation = simulate(folder, step.parameters, step.stop_time).numbered(
            numbers, final, [hands[one] for one in numbers], _largest_lead(step.passes))
        if 0 < simulation.begun_passes < len(step.passes) and not simulation.alarm:
            remark(f"warning: {simulation.begun_passes} of {len(step.passes)} passes were begun until the stop; choose "
                   "a longer --stop-time")
        done.append(save(simulation, folder, job.plan))
    return done


def _largest_lead(passes: Sequence[cycles.Pass]) -> float | None:
    """Of all blocks along Z, where it grows at its end, m per turn; None where none runs along Z."""
    leads = [max(path.lead, path.end_lead) for one in passes for path in one.paths if path.long_axis == "z"]
    return max(leads, default=None)
