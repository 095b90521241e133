"""``threadpitch run``: simulate a lathe that cuts a thread."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console

from threadpitch import cosim, lathe
from threadpitch.cli.options import AsJson, Flavor, StartAngles, number, radians
from threadpitch.cli.printing import complain, fail, print_json, printing, progress
from threadpitch.cosim.values import Given
from threadpitch.faults import fault_names, read_fault
from threadpitch.parameters import read_assignments, read_parameters
from threadpitch.run_folder import check_folder, run_document, save_run
from threadpitch.tables import show_pass

INTERRUPTED = 130
DEFAULT_OUTPUT = "threadpitch-run"


def run(
    system: Annotated[str, typer.Argument(
        metavar="SYSTEM", help="Folder with SystemStructure.ssd, an .ssd or an .ssp.")] = lathe.DEFAULT_SYSTEM,
    assignments: Annotated[list[str] | None, typer.Option(
        "--set", metavar="NAME=VALUE ...", help="Set component.variable, several after one another: SI, or with a "
                                                "unit such as 10mm, 300rpm, 45deg; choices by name.")] = None,
    parameters: Annotated[list[Path] | None, typer.Option(
        metavar="FILE", help="Parameter file: .ssv, .toml or .json; --set wins over it.")] = None,
    fault: Annotated[str | None, typer.Option(
        metavar="NAME", help=f"A fault of the library on a lathe without others: {', '.join(fault_names())}. "
                             "Files and --set win over it.")] = None,
    start_angle: StartAngles = None,
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Stop time in s.", show_default="of the system")] = None,
    step_size: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Communication step in s.", show_default="what the FMUs recommend")] = None,
    flavor: Flavor = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trace.csv, pitch.csv, tables.txt and "
                                                             "result.json.")] = Path(DEFAULT_OUTPUT),
    as_json: AsJson = False,
) -> None:
    """Simulate a lathe that cuts a thread, and print the movement per revolution."""
    check_folder(output)
    chosen = None if fault is None else read_fault(fault)
    values: dict[str, Given] = {} if chosen is None else dict(chosen.parameters)
    if chosen is not None and stop_time is None:
        stop_time = chosen.stop_time
    for file in parameters or []:
        values |= read_parameters(file)
    values |= read_assignments(assignments or [])
    angles = None if start_angle is None else radians(start_angle)
    try:
        with progress("simulating") as told:
            simulation = lathe.simulate(system, parameters=values, start_angles=angles, stop_time=stop_time,
                                        step_size=step_size, flavor=flavor, progress=told)
    except cosim.SimulationInterrupted as interrupt:
        _keep(interrupt, output, lathe.choose_flavor(flavor))
    if simulation.calculators and not simulation.passes:
        fail(simulation.why_no_turn())
    saved = save_run(simulation, output)
    with printing():
        if as_json:
            print_json(run_document(simulation))
        else:
            if chosen is not None:
                print(f"Fault {chosen.name} ({chosen.cause}): {chosen.description}\nSignature: {chosen.signature}\n")
            _show(simulation, saved)
    for warning in simulation.result.warnings:
        complain(f"warning: {warning}")


def _show(simulation: lathe.Simulation, saved: Sequence[Path]) -> None:
    console = Console()
    for one in simulation.passes:
        show_pass(console, one)
        console.print()
    if not simulation.calculators:
        console.print(simulation.why_no_turn())
    simulated = float(simulation.time[-1] - simulation.time[0])
    print(f"{simulation.steps} steps, {simulated:g} s simulated in {simulation.wall_time:.2f} s with "
          f"{simulation.flavor} FMUs\nsaved in {saved[0].parent}: {', '.join(path.name for path in saved)}")


def _keep(interrupt: cosim.SimulationInterrupted, output: Path, flavor: str) -> NoReturn:
    """What was recorded before Ctrl-C is saved."""
    kept = ""
    if interrupt.result is not None:
        kept = f"; what was recorded is in {save_run(lathe.Simulation(interrupt.result, flavor), output)[0].parent}"
    complain(f"{interrupt}{kept}")
    raise typer.Exit(INTERRUPTED)
