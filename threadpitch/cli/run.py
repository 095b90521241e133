"""``threadpitch run``: simulate a lathe that cuts a thread."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch import cosim, lathe
from threadpitch.cli.options import (
    AsJson,
    Assignments,
    Flavor,
    ParameterFiles,
    Replacements,
    StartAngles,
    number,
    radians,
)
from threadpitch.cli.printing import BAD_INPUT, complain, fail, print_json, printing, progress
from threadpitch.cosim.values import Given
from threadpitch.parameters import read_assignments, read_parameters
from threadpitch.replacement import read_replacements
from threadpitch.run_folder import check_folder, run_document, save_run
from threadpitch.tables import show_pass

DEFAULT_OUTPUT = "threadpitch-run"


def run(
    system: Annotated[str, typer.Argument(
        metavar="SYSTEM", help="Folder with SystemStructure.ssd, an .ssd or an .ssp.")] = lathe.DEFAULT_SYSTEM,
    assignments: Assignments = None,
    parameters: ParameterFiles = None,
    replace: Replacements = None,
    start_angle: StartAngles = None,
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Stop time in s.", show_default="of the system")] = None,
    step_size: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Communication step in s.", show_default="what the FMUs recommend")] = None,
    flavor: Flavor = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trace.csv, pitch.csv, tables.txt and "
                                                             "result.json.")] = Path(DEFAULT_OUTPUT),
    record: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help="What is recorded: outputs, inputs, locals, parameters, or component.variable with * "
                                 "and ?.", show_default="outputs, and what tells of the turns")] = None,
    record_every: Annotated[int, typer.Option(metavar="N", help="Record every N-th step.")] = 1,
    record_on: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help="Record only where one of these variables changes.")] = None,
    results: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Record into FILE.parquet (a folder), FILE.csv (both while running) or FILE.mat, instead "
                             "of trace.csv.")] = None,
    checkpoint: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Save the state of the run for `threadpitch resume FILE`, at the end and when it is "
                             "interrupted too.")] = None,
    checkpoint_every: Annotated[float, typer.Option(metavar="S", parser=number, help="Time between two saves in s.")]
    = 60.0,
    isolate: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help="Components in processes of their own, whose crash ends the run in order; all for "
                                 "all.")] = None,
    as_json: AsJson = False,
) -> None:
    """Simulate a lathe that cuts a thread, and print the movement per revolution."""
    check_folder(output)
    values: dict[str, Given] = {}
    for file in parameters or []:
        values |= read_parameters(file)
    values |= read_assignments(assignments or [])
    angles = None if start_angle is None else radians(start_angle)
    with keeping(output, lathe.choose_flavor(flavor)), progress("simulating") as told:
        simulation = lathe.simulate(
            system, parameters=values, start_angles=angles, stop_time=stop_time, step_size=step_size, flavor=flavor,
            record=record, record_every=record_every, record_on=record_on or (), results=results,
            checkpoint=checkpoint, checkpoint_every=checkpoint_every,
            replace={**read_replacements(replace or [])},
            isolate=isolate == ["all"] or isolate or False, progress=told)
    finish(simulation, output, as_json)


def finish(simulation: lathe.Simulation, output: Path, as_json: bool) -> None:
    """Save a simulation that came to its end, and print what it found."""
    if simulation.calculators and not simulation.passes:
        fail(simulation.why_no_turn())
    saved = save_run(simulation, output)
    with printing():
        if as_json:
            print_json(run_document(simulation))
        else:
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
    result = simulation.result
    elsewhere = "" if result.path is None else f", results in {result.path}"
    print(f"{simulation.steps} steps, {simulation.simulated:g} s simulated in {simulation.wall_time:.2f} s with "
          f"{simulation.flavor} FMUs\nsaved in {saved[0].parent}: {', '.join(path.name for path in saved)}{elsewhere}")


@contextlib.contextmanager
def keeping(output: Path, flavor: str) -> Iterator[None]:
    """While a simulation runs: what was recorded before it is ended or fails is saved."""
    try:
        yield
    except (cosim.SimulationInterrupted, cosim.StepError) as error:
        kept = ""
        # A run that fails before its first step leaves the former one.
        if error.result is not None and (error.result.steps or isinstance(error, cosim.SimulationInterrupted)):
            folder = save_run(lathe.Simulation(error.result, flavor), output)[0].parent
            kept = f"; what was recorded is in {error.result.path or folder}"
        complain(f"{error}{kept}")
        raise typer.Exit(128 + error.signal if isinstance(error, cosim.SimulationInterrupted) else BAD_INPUT) from None
