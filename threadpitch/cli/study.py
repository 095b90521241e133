"""``threadpitch study``: many simulated threads, and what they show."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from threadpitch import studies
from threadpitch.cli.kept import stored_line
from threadpitch.cli.options import AsJson, Scheduler, Workers
from threadpitch.cli.printing import fail, print_json, printing, remark
from threadpitch.cli.store_options import Keep
from threadpitch.report.figure import check_figure
from threadpitch.report.study_plot import plot_study
from threadpitch.runs.study import study_run
from threadpitch.store import open_store
from threadpitch.studies.document import values_document
from threadpitch.studies.evaluation import FAILED
from threadpitch.studies.shown_units import with_unit
from threadpitch.study_report import estimate_text, reasons, show_study

INCOMPLETE = 3  # exit status: some rows are not there yet, as with --shard


def study(
    definition: Annotated[Path, typer.Argument(metavar="STUDY", help="Study as a TOML file.", show_default=False)],
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for rows, study.parquet and analysis.json; what "
                                                             "is done in it is not done again.")]
    = Path(studies.DEFAULT_OUTPUT),
    workers: Workers = None,
    scheduler: Scheduler = None,
    queue: Annotated[bool, typer.Option(
        "--queue", metavar="",
        help="Workers are jobs of the queue that the study's table 'cluster' configures (SLURM, PBS, ...).")] = False,
    shard: Annotated[str, typer.Option(
        metavar="I/N", help="Only the I-th of N parts, in this process: for job arrays.")] = "1/1",
    dry_run: Annotated[bool, typer.Option(
        "--dry-run", metavar="", help="How many rows, how long, how much disk; nothing is kept.")] = False,
    row: Annotated[int | None, typer.Option(metavar="N", help="Compute this row alone and print it.")] = None,
    retry_failed: Annotated[bool, typer.Option(
        "--retry-failed", metavar="", help="Compute rows that failed once more.")] = False,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw the responses as .svg, .png or .pdf.")] = None,
    store: Keep = None,
    as_json: AsJson = False,
) -> None:
    """Vary parameters of a simulated lathe: effects, sensitivity, and the yield within the limits."""
    place = studies.Place(workers, scheduler, queue, studies.read_shard(shard))
    if plot is not None:
        check_figure(plot)
    if row is not None:
        _print_row(definition, row, as_json)
        return
    if dry_run:
        _print_estimate(studies.estimate(definition, output=output, place=place), as_json)
        return
    try:
        with counting_rows() as told:
            result = studies.study(definition, output=output, place=place, retry_failed=retry_failed, progress=told)
    except KeyboardInterrupt:
        remark(f"rows that are done are kept in {output}; the same command goes on with the others")
        raise
    if result.analysis.rows and result.analysis.failed == result.analysis.rows:
        fail(f"{definition}: {'all' if result.complete else 'so far all'} {result.analysis.rows} rows failed, "
             f"{next(reasons(result))}; they are kept in {result.folder}; mend the study, or compute them once more "
             "with --retry-failed")
    if plot is not None:
        plot_study(result, plot)
    stored: dict[str, object] = {}
    if store is not None and result.complete:
        with open_store(store) as opened:
            number = opened.add(study_run(result, str(definition)))
            stored = {"stored": {"run": number, "store": opened.address}}
    with printing():
        if as_json:
            print_json({"output": str(result.folder), "missing": result.missing, **stored,
                        **result.document})
        else:
            console = Console()
            show_study(console, result)
            kept = "study.parquet, analysis.json" if result.complete else f"{result.missing} rows are still missing"
            print(f"\nsaved in {result.folder}: {kept}")
            if stored:
                print(stored_line(stored))
    if not result.complete:
        raise typer.Exit(INCOMPLETE)


@contextmanager
def counting_rows(label: str = "rows") -> Iterator[studies.making.Progress]:
    """A bar with rate and time left on standard error; nothing where that is no terminal."""
    console = Console(stderr=True)
    bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                   TextColumn("{task.fields[rate]}"), TimeRemainingColumn(), console=console, transient=True,
                   disable=not console.is_terminal)
    task = bar.add_task(label, total=None, rate="")

    def told(done: int, rows: int) -> None:
        speed = bar.tasks[task].speed
        bar.update(task, completed=done, total=rows, rate="" if speed is None else f"{speed:.3g}/s")

    with bar:
        yield told


def _print_row(definition: Path, number: int, as_json: bool) -> None:
    parameters, outcome = studies.row(definition, number)
    if outcome.status == FAILED:
        fail(f"row {number}: {outcome.reason}")
    units = studies.units(definition)
    with printing():
        if as_json:
            print_json({"row": number, **values_document(parameters, outcome.values, units)})
            return
        for name, value in {**parameters, **outcome.values}.items():
            print(f"{name} = {with_unit(value, units.get(name))}")


def _print_estimate(found: studies.Estimate, as_json: bool) -> None:
    with printing():
        if as_json:
            print_json({"rows": found.rows, "missing": found.missing, "row_s": found.row_time,
                        "workers": found.workers, "wall_s": found.wall_time, "disk_bytes": found.disk})
        else:
            print(estimate_text(found))
