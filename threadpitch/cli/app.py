"""The command line: its commands, what they end with, and how the process is left."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer

from threadpitch import __version__, cosim, lathe
from threadpitch.approach import ApproachError
from threadpitch.cli.analyze import analyze
from threadpitch.cli.approach import approach
from threadpitch.cli.build import build
from threadpitch.cli.check import check
from threadpitch.cli.cycle import cycle
from threadpitch.cli.fit import fit
from threadpitch.cli.options import ADDRESS, KEEPERS, SEVERAL, STORE
from threadpitch.cli.printing import complain, printing
from threadpitch.cli.publish import publish
from threadpitch.cli.report import report
from threadpitch.cli.resume import resume
from threadpitch.cli.run import run
from threadpitch.cli.serve import serve
from threadpitch.cli.store import store
from threadpitch.cli.study import study
from threadpitch.cli.tune import tune
from threadpitch.cli.watch import watch
from threadpitch.cosim.interrupt import Terminated, end_in_order
from threadpitch.cycles import CycleError
from threadpitch.drive_fit import FitError
from threadpitch.fmu import BuildError, ModelError
from threadpitch.judgement import JudgementError
from threadpitch.parameters import ParameterFileError
from threadpitch.pitch import PitchError
from threadpitch.program_parameters import OperationError
from threadpitch.publish import PublishError
from threadpitch.report.content import ReportError
from threadpitch.report.figure import PlotError
from threadpitch.serve import ServeError
from threadpitch.store import DEFAULT, StoreError
from threadpitch.studies import StudyError
from threadpitch.tolerance import ToleranceError
from threadpitch.trace import TraceError
from threadpitch.units import UnitError

_KNOWN_ERRORS = (ApproachError, cosim.CosimError, lathe.LatheError, BuildError, CycleError, FitError, JudgementError,
                 ModelError, OperationError, ParameterFileError, PitchError, PlotError, PublishError, ReportError,
                 ServeError, StoreError, StudyError, ToleranceError, TraceError, UnitError, OSError)

_HELP = frozenset(("--help", "-h"))

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  context_settings={"help_option_names": sorted(_HELP)},
                  help="Did the machine tool cut this thread's pitch right, and if not, why? Movement of the feed per "
                       "spindle revolution, from a simulated lathe of FMUs or from a machine's log.")
for _command in (run, resume, check, analyze, watch, build, cycle, approach, report, study, tune, fit, publish, serve):
    app.command()(_command)
app.add_typer(store, name="store")


@app.callback(invoke_without_command=True)
def _options(version: Annotated[bool, typer.Option(
        "--version", metavar="", help="Print the version.")] = False) -> None:
    if version:
        with printing():
            print(f"threadpitch {__version__}")
        raise typer.Exit


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave the process: 0, 2 for bad input (one line on standard error), 130 after Ctrl-C."""
    end_in_order()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names may hold what the terminal's encoding does not
    if sys.stdout is None:
        status = complain("standard output is closed; send it to a file, or to nowhere (> /dev/null)")
    else:
        status = invoke(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):  # no attribute: the stream is closed
            stream.flush()
    # Without the destructors of loaded libraries: PythonFMU's, which glibc keeps, touches memory that is already freed.
    os._exit(status)


def invoke(arguments: Sequence[str]) -> int:
    """The command line's exit status; what is wrong goes to standard error in one line."""
    # Not app(): what that does with Ctrl-C and closed pipes differs from version to version.
    helping = not arguments or not _HELP.isdisjoint(arguments)
    try:
        with printing() if helping else contextlib.nullcontext(), \
                typer.main.get_command(app).make_context("threadpitch", _one_value_each(arguments)) as context:
            context.command.invoke(context)
    except typer.Exit as end:
        return end.exit_code
    except typer.TyperException as error:
        return complain(_usage(error))
    except _KNOWN_ERRORS as error:
        return complain(_file_message(error) if isinstance(error, OSError) else str(error))
    except KeyboardInterrupt as error:
        complain("interrupted")
        return 128 + (error.signal if isinstance(error, Terminated) else signal.SIGINT)
    return 0


def _one_value_each(arguments: Sequence[str]) -> list[str]:
    """``--start-angle 0 90`` as ``--start-angle 0 --start-angle 90``: several values may follow one option.

    ``--store`` alone is ``--store default`` where a command keeps a run.
    """
    expanded: list[str] = []
    option = ""
    alone = STORE if arguments and arguments[0] in KEEPERS else None
    for number, argument in enumerate(arguments):
        if argument == "--":
            return [*expanded, *([DEFAULT] if expanded and expanded[-1] == alone else []), *arguments[number:]]
        if expanded and expanded[-1] == alone and not re.fullmatch(ADDRESS, argument):
            expanded.append(DEFAULT)
        follows = bool(option) and re.fullmatch(SEVERAL[option], argument) is not None
        if follows and expanded[-1] != option:
            expanded.append(option)
        elif not follows:
            name = argument.partition("=")[0]
            option = name if name in SEVERAL else ""
        expanded.append(argument)
    return [*expanded, DEFAULT] if expanded and expanded[-1] == alone else expanded


def _file_message(error: OSError) -> str:
    if error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror.lower()}" if error.filename else error.strerror


def _usage(error: typer.TyperException) -> str:
    """What is wrong with the arguments, and where their help is, unless the message itself tells how to mend it."""
    message = error.format_message().rstrip(".") or "a command is missing"
    context = getattr(error, "ctx", None)
    return message if ";" in message else f"{message}; see {context.command_path if context else 'threadpitch'} --help"
