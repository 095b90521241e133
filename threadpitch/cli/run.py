"""``threadpitch run``: simulate a lathe that cuts a thread."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from threadpitch import cycles, lathe
from threadpitch.cli.coupling import (
    DEFAULT,
    Adaptive,
    Coupling,
    Events,
    Extrapolation,
    Multiples,
    Tolerance,
    Words,
    read_method,
)
from threadpitch.cli.kept import Keeper, check_store, keeping_run
from threadpitch.cli.option_records import with_option_records
from threadpitch.cli.options import (
    AsJson,
    Assignments,
    Control,
    Dialect,
    Flavor,
    Increments,
    Measure,
    ParameterFiles,
    Replacements,
    StartAngles,
    Starts,
    Waiting,
    increment_system,
    indexing,
    number,
    radians,
    refuse,
)
from threadpitch.cli.outcome import DEFAULT_OUTPUT, finish, finish_program, keeping, save
from threadpitch.cli.printing import fail, printing, progress
from threadpitch.cli.program import Job, run_program
from threadpitch.cli.store_options import NOT_KEPT, KeepOptions, ThreadName, refuse_labels_of_nothing
from threadpitch.cosim.keeping import SAVING_TIME
from threadpitch.cosim.values import Given
from threadpitch.faults import fault_names, read_fault
from threadpitch.measuring import read_plan
from threadpitch.parameters import read_assignments, read_parameters
from threadpitch.replacement import read_replacements
from threadpitch.run_folder import check_folder

_OF_PROGRAM = ("control", "dialect", "starts", "wait", "increments")


@with_option_records
def run(
    context: typer.Context,
    system: Annotated[str, typer.Argument(
        metavar="SYSTEM", help="Folder with SystemStructure.ssd, an .ssd or an .ssp.")] = lathe.DEFAULT_SYSTEM,
    program: Annotated[Path | None, typer.Option(
        metavar="FILE", help="NC program whose threads the lathe cuts, operation by operation; --set wins over its "
                             "words.")] = None,
    dialect: Dialect = cycles.TOMATECH.name,
    starts: Starts = 1,
    wait: Waiting = "once",
    increments: Increments = cycles.IncrementSystem.IS_B.value,
    control: Control = None,
    assignments: Assignments = None,
    parameters: ParameterFiles = None,
    replace: Replacements = None,
    fault: Annotated[str | None, typer.Option(
        metavar="NAME", help=f"A fault of the library on a lathe without others: {', '.join(fault_names())}. A "
                             "program, files and --set win over it.")] = None,
    measure: Measure = None,
    start_angle: StartAngles = None,
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Stop time in s.", show_default="of the system")] = None,
    step_size: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Communication step in s.", show_default="what the FMUs recommend")] = None,
    coupling: Coupling = DEFAULT.coupling,
    extrapolation: Extrapolation = 0,
    multiple: Multiples = None,
    tolerance: Tolerance = DEFAULT.tolerance,
    adaptive: Adaptive = None,
    event: Events = None,
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
    checkpoint_every: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Time between two saves in s.", show_default=f"{SAVING_TIME:g}")] = None,
    isolate: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help="Components in processes of their own, whose crash ends the run in order; all for "
                                 "all.")] = None,
    keep: KeepOptions = NOT_KEPT,
    thread: ThreadName = "",
    as_json: AsJson = False,
) -> None:
    """Simulate a lathe that cuts a thread, print the movement per revolution and where its fluctuation comes from."""
    check_folder(output, results, checkpoint)
    if program is None:
        refuse(context, _OF_PROGRAM, "belongs to --program; for a run without one use --set controller.starts=2 and "
                                     "the like")
    refuse_labels_of_nothing(context, "thread")
    if checkpoint is None and checkpoint_every is not None:
        fail("--checkpoint-every saves nothing without --checkpoint FILE; give one")
    chosen = None if fault is None else read_fault(fault)
    plan = None if measure is None else read_plan(measure)
    values: dict[str, Given] = {}
    for file in parameters or []:
        values |= read_parameters(file)
    values |= read_assignments(assignments or [])
    angles = None if start_angle is None else radians(start_angle)
    replaced = {**read_replacements(replace or [])}
    faulty = {} if chosen is None else chosen.parameters
    method = read_method(Words(coupling, extrapolation, multiple or (), tolerance, adaptive, event or ()))

    def simulated(folder: Path, words: Mapping[str, Given], enough: float | None,
                  keeper: Keeper | None = None) -> lathe.Simulation:
        with keeping(folder, lathe.choose_flavor(flavor)), progress("simulating") as told:
            return lathe.simulate(
                system, parameters={**faulty, **words, **values}, start_angles=angles, step_size=step_size,
                flavor=flavor, stop_time=enough if stop_time is None else stop_time, record=record,
                record_every=record_every, record_on=record_on or (), results=results, checkpoint=checkpoint,
                checkpoint_every=SAVING_TIME if checkpoint_every is None else checkpoint_every, method=method,
                replace=replaced, isolate=isolate == ["all"] or isolate or False, progress=told,
                turned=None if keeper is None else keeper.live)

    kept = keep.asked(thread=thread, program="" if program is None else program.name)
    if program is None:
        with keeping_run(kept, "simulation", system) as keeper:
            simulation = simulated(output, {}, None if chosen is None else chosen.stop_time, keeper)
            if chosen is not None and not as_json:
                with printing():
                    print(f"Fault {chosen.name} ({chosen.cause}): {chosen.description}\n"
                          f"Signature: {chosen.signature}\n")
            finish(save(simulation, output, plan), as_json, keeper)
        return
    if results is not None or checkpoint is not None:
        fail("--results and --checkpoint hold one simulation; a program is several: leave them out")
    check_store(kept)
    setup = cycles.Setup(dialect=cycles.dialect_named(dialect), starts=starts, indexing=indexing(wait),
                         increments=increment_system(increments))
    words = None if control is None else cycles.ParameterFile(control)
    finish_program(run_program(Job(program, setup, words, plan), output, simulated), as_json, kept, str(program))
