"""``threadpitch check``: what a system is made of, and everything that is wrong with it, without running it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch import lathe
from threadpitch.cli.options import AsJson, Assignments, Flavor, ParameterFiles, Replacements
from threadpitch.cli.printing import BAD_INPUT, complain, print_json, printing
from threadpitch.cosim.values import Given
from threadpitch.parameters import read_assignments, read_parameters
from threadpitch.replacement import read_replacements
from threadpitch.system_report import check_system, show_survey, survey_document


def check(
    system: Annotated[str, typer.Argument(
        metavar="SYSTEM", help="Folder with SystemStructure.ssd, an .ssd or an .ssp.")] = lathe.DEFAULT_SYSTEM,
    assignments: Assignments = None,
    parameters: ParameterFiles = None,
    replace: Replacements = None,
    flavor: Flavor = None,
    as_json: AsJson = False,
) -> None:
    """Check a system without running it: components, connections, order, loops, and every problem at once."""
    values: dict[str, Given] = {}
    for file in parameters or []:
        values |= read_parameters(file)
    values |= read_assignments(assignments or [])
    chosen: dict[str, str | Path] = {**read_replacements(replace or [])}
    found = check_system(system, values, flavor=flavor, replace=chosen)
    with printing():
        if as_json:
            print_json(survey_document(found))
        else:
            console = Console()
            show_survey(Console(width=max(console.width, 120)), found)
    for problem in found.problems:
        complain(problem)
    if found.problems:
        raise typer.Exit(BAD_INPUT)
