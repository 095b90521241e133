"""Options that keep a run: which store, and what is to be known of it later."""

from __future__ import annotations

from typing import Annotated

import typer

from threadpitch.cli.options import refuse
from threadpitch.store import ENVIRONMENT

_WHERE = "a file like runs.db, or postgresql://user@host/name"
Keep = Annotated[str | None, typer.Option(
    "--store", metavar="[URL]", help=f"Keep the run in this store: {_WHERE}; without a value {ENVIRONMENT} or the "
                                     "user's own.")]
StoreAddress = Annotated[str | None, typer.Option(
    "--store", metavar="URL", help=f"The store: {_WHERE}.", show_default=f"{ENVIRONMENT}, else the user's own")]
Machine = Annotated[str, typer.Option("--machine", metavar="NAME", help="The machine, kept with the run.")]
ProgramName = Annotated[str, typer.Option("--program-name", metavar="NAME", help="The program, kept with the run.")]
ThreadName = Annotated[str, typer.Option("--thread", metavar="NAME", help="The thread, kept with the run.")]
SerialNumber = Annotated[str, typer.Option("--serial", metavar="NUMBER", help="The part's serial number, kept with "
                                                                              "the run.")]
Note = Annotated[str, typer.Option("--note", metavar="TEXT", help="The operator's note, kept with the run.")]
Publish = Annotated[list[str] | None, typer.Option(
    "--publish", metavar="URL", help="Bring values to an MQTT broker (mqtts://user@host/prefix) or be an OPC UA server "
                                     "(opc.tcp://127.0.0.1:4840); the run is kept in the store.")]


def refuse_labels_of_nothing(context: typer.Context, *more: str) -> None:
    """Labels where no run is kept.

    Raises:
        LatheError: one of them was given.
    """
    if context.params["store"] is None and not context.params["publish"]:
        refuse(context, ("machine", "program_name", "serial", "note", *more),
               "is kept with a run; give --store or --publish too, or leave it out")
