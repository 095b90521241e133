"""``threadpitch report``: runs and logs as a page or as paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from threadpitch.cli.analyze import CROSSINGS
from threadpitch.cli.judging import NO_TOLERANCE
from threadpitch.cli.log_options import Latency, LogOptions, Outlier
from threadpitch.cli.option_records import with_option_records
from threadpitch.cli.options import OF_THREAD, WITHOUT_MEASURED, WITHOUT_THREAD, StartAngles, number, radians, refuse
from threadpitch.cli.printing import ReadingLine, fail, printing
from threadpitch.judgement.measured_file import read_measured
from threadpitch.pitch import PitchTable, pitch_tables
from threadpitch.report.content import Report, Thread
from threadpitch.report.limits import Allowed, limited
from threadpitch.report.output import check_output, write_report
from threadpitch.report.recorded_log import LogQuestion, chosen_groups, log_thread
from threadpitch.report.recorded_run import read_run
from threadpitch.report.study_document import write_study
from threadpitch.sparkline import deviation_lines, variable_deviation_lines, verdict_line
from threadpitch.studies import is_study, kept
from threadpitch.study_report import sentences
from threadpitch.tables import printable
from threadpitch.tolerance import parse_thread
from threadpitch.units import to_si

_NAMED = 3  # threads in a title


_OF_LOG = (*(one.name for one in fields(LogOptions)), "latency", "outlier", "crossing", "start_angle", "target",
           "lead_change")


@with_option_records
def report(
    context: typer.Context,
    inputs: Annotated[list[Path], typer.Argument(
        metavar="RESULT|LOG|STUDY ...",
        help="Folder of a run, or a log; of several the curves lie over one another. Or the folder of a study.")],
    of_log: LogOptions,
    output: Annotated[Path, typer.Option(
        "--output", "-o", metavar="FILE", help="FILE.html, one file that opens offline, or FILE.pdf.")]
    = Path("report.html"),
    title: Annotated[str | None, typer.Option(metavar="TEXT", help="Title of the report.",
                                              show_default="names of the inputs")] = None,
    chosen: Annotated[str | None, typer.Option(
        "--pass", metavar="NAME|all", help="Pass of a run or group of a log.",
        show_default="what makes the final flank, the last group")] = None,
    latency: Latency = 0.0,
    outlier: Outlier = None,
    crossing: Annotated[str, typer.Option(
        metavar="linear|edges", help="How xi at a crossing is found, as for analyze.")] = "linear",
    start_angle: StartAngles = None,
    measured: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Measured pitches of the thread in the log, as for analyze.")] = None,
    target: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Movement per revolution that was wanted in the log.",
        show_default="of --thread, else the median")] = None,
    lead_change: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="What the lead in the log changes by in every turn, from --target at the "
                                          "first sample on, as for analyze.")] = None,
    uncertainty: Annotated[float | None, typer.Option(
        metavar="UM", parser=number, help="Standard uncertainty of one measured pitch.",
        show_default="a run keeps its verdict")] = None,
    ball_screw: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Lead of the feed's ball screw.", show_default="--screw-lead")] = None,
    thread: Annotated[str | None, typer.Option(
        metavar="DESIGNATION", help="M20x1.5-6g and the like: its tolerance gives the limits.")] = None,
    limit: Annotated[float, typer.Option(
        metavar="PERCENT", parser=number, help="Share of the pitch-diameter tolerance that deviations may take.")]
    = 25.0,
    engagement: Annotated[float | None, typer.Option(
        metavar="MM", parser=number, help="Length over which they add up.", show_default="longest normal one")] = None,
) -> None:
    """Runs and logs, or a study, as one HTML file that opens offline, or a PDF: tables, verdict, charts, provenance."""
    check_output(output)
    if any(is_study(path) for path in inputs):
        if len(inputs) > 1:
            fail("a study is a report of its own: give its folder alone")
        refuse(context, (*_OF_LOG, "chosen", "measured", "uncertainty", "ball_screw", "thread", *OF_THREAD),
               "belongs to runs and logs, not to a study; leave it out")
        result = kept(inputs[0])
        write_study(result, title, output)
        with printing():
            for sentence in sentences(result.document):
                print(sentence)
            print(f"saved in {output}")
        return
    if crossing not in CROSSINGS:
        fail(f"crossing {crossing!r} is not known; choose {' or '.join(CROSSINGS)}")
    if uncertainty is not None and uncertainty <= 0.0:
        fail(f"uncertainty {uncertainty:g} um is not positive; give the standard uncertainty of one pitch, like 1")
    if measured is not None and all(path.is_dir() for path in inputs):
        fail("--measured belongs to a log; a run keeps its own verdict: leave it out, or measure the thread by "
             "threadpitch run --measure")
    if all(path.is_dir() for path in inputs):
        refuse(context, _OF_LOG, "belongs to a log, not to a run; leave it out")
    if measured is None:
        refuse(context, ("ball_screw",), WITHOUT_MEASURED)
    if thread is None:
        refuse(context, OF_THREAD, WITHOUT_THREAD)
    if lead_change:
        _check_lead_change(target, thread)
    choice = of_log.choice()
    signals = of_log.signals(target, latency=latency, outlier=None if outlier is None else 1e-3 * outlier)
    designation = None if thread is None else parse_thread(thread)
    wanted = _si(target, "mm") if target is not None or designation is None else designation.lead
    question = LogQuestion(wanted, () if measured is None else tuple(read_measured(measured)), _si(uncertainty, "um"),
                           _si(of_log.screw_lead if ball_screw is None else ball_screw, "mm"),
                           to_si(lead_change or 0.0, "mm"))
    starts = radians(start_angle or [0.0])

    def threads_of(path: Path) -> list[Thread]:
        if path.is_dir():
            return read_run(path, chosen, question.uncertainty)
        with ReadingLine("reading") as line:
            groups = pitch_tables(path, choice, starts, signals, CROSSINGS[crossing], told=line.told,
                                  read=line.read)
        return [log_thread(path, one, groups, question) for one in chosen_groups(groups, path, chosen)]

    threads = [one for path in inputs for one in threads_of(path)]
    if designation is not None:
        allowed = Allowed(designation, limit / 100.0, _si(engagement, "mm"), question.uncertainty or 0.0)
        threads = [limited(one, allowed) for one in threads]
    write_report(Report(title or _title(threads), tuple(threads)), output)
    with printing():
        console = Console()
        for one in threads:
            console.print(Text(printable(one.name), style="bold"))
            for line in _deviation_lines(console, one):
                console.print(line)
            if one.verdict is not None:
                console.print(verdict_line(one.verdict.cause, printable(one.verdict.sentence)))
            for note in one.notes:
                console.print(Text(printable(note)))
        print(f"saved in {output}")


def _deviation_lines(console: Console, one: Thread) -> list[Text]:
    if one.lead_change:
        less = PitchTable.of_pitches(one.deviation, one.nominal.start_angles)
        return variable_deviation_lines(console, less, one.chosen)
    return deviation_lines(console, one.nominal, one.target, one.chosen)


def _check_lead_change(target: float | None, thread: str | None) -> None:
    if thread is not None:
        fail(NO_TOLERANCE)
    if target is None:
        fail("--lead-change counts from the lead at the first sample; give it with --target in mm")


def _title(threads: Sequence[Thread]) -> str:
    """The names of the first threads."""
    named = ", ".join(one.name for one in threads[:_NAMED])
    return f"Thread pitch: {named}{', ...' if len(threads) > _NAMED else ''}"


def _si(value: float | None, unit: str) -> float | None:
    return None if value is None else to_si(value, unit)
