"""``threadpitch resume``: go on with a run from its checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from threadpitch import cosim, lathe
from threadpitch.cli.options import AsJson, number
from threadpitch.cli.outcome import DEFAULT_OUTPUT, finish, keeping, save
from threadpitch.cli.printing import progress
from threadpitch.run_folder import check_folder


def resume(
    checkpoint: Annotated[Path, typer.Argument(metavar="FILE", help="What `threadpitch run --checkpoint` wrote.")],
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Stop time in s.", show_default="of the run")] = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trace.csv, pitch.csv, tables.txt and "
                                                             "result.json.")] = Path(DEFAULT_OUTPUT),
    as_json: AsJson = False,
) -> None:
    """Go on with a run that was interrupted, or to a later stop time, as if it had never ended."""
    saved = cosim.read_checkpoint(checkpoint)
    results = saved.document["results"].get("path")
    check_folder(output, checkpoint, None if results is None else Path(results))
    flavor = str(saved.metadata["about"].get("flavor", "native"))
    with keeping(output, flavor), progress("simulating") as told:
        simulation = lathe.resume(checkpoint, stop_time=stop_time, progress=told)
    finish(save(simulation, output, None), as_json)
