"""``threadpitch tune``: the parameters that make an outcome least within limits."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from threadpitch import studies
from threadpitch.cli.options import AsJson, Scheduler, Workers
from threadpitch.cli.printing import fail, print_json, printing, remark
from threadpitch.cli.study import counting_rows
from threadpitch.fmu.cache import write_file
from threadpitch.studies.document import values_document
from threadpitch.studies.shown_units import with_unit
from threadpitch.studies.tuning import DEFAULT_OUTPUT


def tune(
    definition: Annotated[Path, typer.Argument(metavar="TUNE", help="A study as a TOML file, with a table 'tune'.",
                                               show_default=False)],
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for what was computed; a search that was stopped "
                                                             "goes on in it.")] = Path(DEFAULT_OUTPUT),
    workers: Workers = None,
    scheduler: Scheduler = None,
    queue: Annotated[bool, typer.Option(
        "--queue", metavar="",
        help="Workers are jobs of the queue that the table 'cluster' configures (SLURM, PBS, ...).")] = False,
    parameters: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Write the best parameters as TOML for run --parameters.")] = None,
    as_json: AsJson = False,
) -> None:
    """Choose gain, feedforward, approach or speed so that an outcome is least and the others keep their limits."""
    if parameters is not None and parameters.suffix != ".toml":
        fail(f"{parameters}: parameters are written as TOML; give the file such a name")
    try:
        with counting_rows("points") as told:
            found = studies.tune(definition, output=output, workers=workers, scheduler=scheduler, queue=queue,
                                 progress=told)
    except KeyboardInterrupt:
        remark(f"what was computed is kept in {output}; the same command goes on from there")
        raise
    if parameters is not None:
        lines = [f'"{name}" = {value!r}' for name, value in found.parameters.items()]
        write_file(parameters, "\n".join([*lines, ""]).encode())
    with printing():
        if as_json:
            print_json({**values_document(found.parameters, found.outcomes, found.units),
                        "within_limits": found.within_limits, "evaluations": found.evaluations})
            return
        print(f"Best of {found.evaluations} points" + ("" if found.within_limits else ", OUTSIDE of a limit") + ":")
        for name, value in {**found.parameters, **found.outcomes}.items():
            limit, unit = found.study.limits.get(name), found.units.get(name)
            allowed = "" if limit is None else f" (limit {with_unit(limit, unit)})"
            print(f"  {name} = {with_unit(value, unit)}{allowed}")
        print(f"saved in {found.folder}")
