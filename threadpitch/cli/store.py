"""``threadpitch store``: find, look at, compare, take out and check the runs that are kept."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch.cli.options import AsJson
from threadpitch.cli.printing import fail, print_json, printing
from threadpitch.cli.store_options import StoreAddress
from threadpitch.cli.store_tables import compared, comparison_document, show_run, show_runs
from threadpitch.store import RunFilter, find_store
from threadpitch.store.documents import run_document, summary_document
from threadpitch.tables import printable

store = typer.Typer(no_args_is_help=True, help="Runs that were kept by --store: find, look at, compare, take out, "
                                               "check.")

Number = Annotated[int, typer.Argument(metavar="RUN", help="Number of the run.", min=1)]
Numbers = Annotated[list[int], typer.Argument(metavar="RUN ...", help="Numbers of runs.", min=1)]


def _instant(text: str) -> datetime:
    """A day or an instant; without a zone it is that of this computer."""
    try:
        return datetime.fromisoformat(text).astimezone(UTC)
    except (ValueError, OverflowError):
        raise typer.BadParameter(f"{text!r} is no time; write it like 2026-01-31 or 2026-01-31T14:30") from None


@store.command("list")
def list_runs(
    text: Annotated[str, typer.Argument(metavar="TEXT", help="Part of the machine, program, thread, serial number, "
                                                             "note, source or cause.")] = "",
    address: StoreAddress = None,
    machine: Annotated[str | None, typer.Option(metavar="NAME", help="Only of this machine.")] = None,
    program_name: Annotated[str | None, typer.Option(metavar="NAME", help="Only of this program.")] = None,
    thread: Annotated[str | None, typer.Option(metavar="NAME", help="Only of this thread.")] = None,
    serial: Annotated[str | None, typer.Option(metavar="NUMBER", help="Only of this serial number.")] = None,
    cause: Annotated[str | None, typer.Option(metavar="CAUSE", help="Only with this verdict: control, mechanical, "
                                                                    "both, none, undetermined.")] = None,
    since: Annotated[datetime | None, typer.Option(metavar="TIME", parser=_instant, help="Not before.")] = None,
    until: Annotated[datetime | None, typer.Option(metavar="TIME", parser=_instant, help="Not after.")] = None,
    limit: Annotated[int, typer.Option(metavar="N", min=1, help="At most so many, the newest.")] = 50,
    as_json: AsJson = False,
) -> None:
    """The runs of a store, newest first."""
    wanted = RunFilter(text=text, machine=machine, program=program_name, thread=thread, serial_number=serial,
                       cause=cause, since=since, until=until, limit=limit)
    with find_store(address) as kept:
        runs, count = kept.runs(wanted), kept.count(wanted)
        where = kept.address
    with printing():
        if as_json:
            print_json({"store": where, "count": count, "runs": [summary_document(run) for run in runs]})
        else:
            show_runs(Console(), runs)
            print(f"{len(runs)} of {count} runs in {printable(where)}")


@store.command()
def show(run: Number, address: StoreAddress = None, as_json: AsJson = False) -> None:
    """A run: what is known of it, its tables, its verdict."""
    with find_store(address) as kept:
        found = kept.run(run)
    with printing():
        if as_json:
            print_json(run_document(found))
        else:
            show_run(Console(), found)


@store.command()
def compare(runs: Numbers, address: StoreAddress = None, as_json: AsJson = False) -> None:
    """Mean and spread of P(n) of several runs side by side, pass by pass and start angle by start angle."""
    if len(runs) < 2:
        fail("one run cannot be compared; give the numbers of two or more")
    with find_store(address) as kept:
        found = [kept.run(number).summary for number in runs]
    with printing():
        if as_json:
            print_json(comparison_document(found))
        else:
            console = Console()
            console.print(compared(console, found))


@store.command()
def export(
    runs: Numbers,
    form: Annotated[str, typer.Option("--format", metavar="csv|json|parquet",
                                      help="csv: every P(n); json: all of the run; parquet: every P(n), and the "
                                           "trace.")] = "csv",
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the files, which are called by the run's "
                                                             "number.")] = Path(),
    address: StoreAddress = None,
    as_json: AsJson = False,
) -> None:
    """Write runs into files for other programs."""
    with find_store(address) as kept:
        written = [path for number in runs for path in kept.export(number, output, form)]
    with printing():
        if as_json:
            print_json({"files": [str(path) for path in written]})
        else:
            print("\n".join(printable(str(path)) for path in written))


@store.command()
def note(run: Number, text: Annotated[str, typer.Argument(metavar="TEXT", help="The new note; '' for none.")],
         address: StoreAddress = None) -> None:
    """Change the operator's note of a run."""
    with find_store(address) as kept:
        kept.set_note(run, text)


@store.command()
def delete(runs: Numbers, address: StoreAddress = None) -> None:
    """Remove runs, with the traces that no other run has."""
    with find_store(address) as kept:
        kept.delete(runs)
    with printing():
        print(f"deleted {len(runs)} of the runs in {printable(kept.address)}")


@store.command()
def verify(
    address: StoreAddress = None,
    clean: Annotated[bool, typer.Option("--clean", metavar="", help="Remove what interrupted writers left.")] = False,
    as_json: AsJson = False,
) -> None:
    """Check every trace and the database; exit status 2 where something is damaged or missing."""
    with find_store(address) as kept:
        found, removed = kept.verify(), kept.remove_leftovers() if clean else 0
        count, where = kept.count(), kept.address
    if clean:
        found = [one for one in found if not one.harmless]
    wrong = sum(not one.harmless for one in found)
    with printing():
        if as_json:
            print_json({"store": where, "runs": count, "removed": removed,
                        "findings": [{"kind": one.kind, "what": one.what} for one in found]})
        else:
            for one in found:
                print(printable(f"{one.kind}: {one.what}"))
            print(printable(f"{count} runs in {where}, {wrong} faults{f', {removed} leftovers removed' * clean}"))
    if wrong:
        fail(f"{where}: {wrong} of its parts damaged or missing; restore them from a copy")
