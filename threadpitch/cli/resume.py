"""``threadpitch resume``: go on with a run from its checkpoint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from threadpitch import cosim, lathe
from threadpitch.cli.kept import keeping_run
from threadpitch.cli.option_records import with_option_records
from threadpitch.cli.options import AsJson, number
from threadpitch.cli.outcome import DEFAULT_OUTPUT, finish, keeping, save
from threadpitch.cli.printing import progress
from threadpitch.cli.store_options import NOT_KEPT, KeepOptions, ThreadName, refuse_labels_of_nothing
from threadpitch.run_folder import check_folder


@with_option_records
def resume(
    context: typer.Context,
    checkpoint: Annotated[Path, typer.Argument(metavar="FILE", help="What `threadpitch run --checkpoint` wrote.")],
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=number, help="Stop time in s.", show_default="of the run")] = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trace.csv, pitch.csv, tables.txt and "
                                                             "result.json.")] = Path(DEFAULT_OUTPUT),
    keep: KeepOptions = NOT_KEPT,
    thread: ThreadName = "",
    as_json: AsJson = False,
) -> None:
    """Go on with a run that was interrupted, or to a later stop time, as if it had never ended."""
    refuse_labels_of_nothing(context, "thread")
    saved = cosim.read_checkpoint(checkpoint)
    results = saved.document["results"].get("path")
    check_folder(output, checkpoint, None if results is None else Path(results))
    flavor = str(saved.metadata["about"].get("flavor", "native"))
    with keeping_run(keep.asked(thread=thread), "simulation", str(saved.metadata["system"] or checkpoint)) as keeper:
        with keeping(output, flavor), progress("simulating") as told:
            simulation = lathe.resume(checkpoint, stop_time=stop_time, progress=told,
                                      turned=None if keeper is None else keeper.live)
        finish(save(simulation, output, None), as_json, keeper)
