"""Options that keep a run: which store, and what is to be known of it later."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from threadpitch.cli.kept import Asked
from threadpitch.cli.options import refuse
from threadpitch.runs import Labels
from threadpitch.store import ENVIRONMENT

_WHERE = "a file like runs.db, or postgresql://user@host/name"
Keep = Annotated[str | None, typer.Option(
    "--store", metavar="[URL]", help=f"Keep the run in this store: {_WHERE}; without a value {ENVIRONMENT} or the "
                                     "user's own.")]
StoreAddress = Annotated[str | None, typer.Option(
    "--store", metavar="URL", help=f"The store: {_WHERE}.", show_default=f"{ENVIRONMENT}, else the user's own")]
ThreadName = Annotated[str, typer.Option("--thread", metavar="NAME", help="The thread, kept with the run.")]


@dataclass(frozen=True)
class KeepOptions:
    """The options themselves; ``--thread`` is none of them, because to some commands it says more."""

    store: Keep = None
    machine: Annotated[str, typer.Option(metavar="NAME", help="The machine, kept with the run.")] = ""
    program_name: Annotated[str, typer.Option(metavar="NAME", help="The program, kept with the run.")] = ""
    serial: Annotated[str, typer.Option(metavar="NUMBER", help="The part's serial number, kept with the run.")] = ""
    note: Annotated[str, typer.Option(metavar="TEXT", help="The operator's note, kept with the run.")] = ""
    publish: Annotated[list[str] | None, typer.Option(
        metavar="URL", help="Bring values to an MQTT broker (mqtts://user@host/prefix) or be an OPC UA server "
                            "(opc.tcp://127.0.0.1:4840); the run is kept in the store.")] = None

    def asked(self, *, thread: str, program: str = "") -> Asked:
        """What is to be kept; ``program`` is its name unless another is given."""
        labels = Labels(self.machine, self.program_name or program, thread, self.serial, self.note)
        return Asked(self.store, tuple(self.publish or ()), labels)


NOT_KEPT = KeepOptions()


def refuse_labels_of_nothing(context: typer.Context, *more: str) -> None:
    """Labels where no run is kept.

    Raises:
        LatheError: one of them was given.
    """
    if context.params["store"] is None and not context.params["publish"]:
        refuse(context, ("machine", "program_name", "serial", "note", *more),
               "is kept with a run; give --store or --publish too, or leave it out")
