"""The command line: ``threadpitch run | analyze | build``. Degrees, mm and rpm at this edge, SI inside."""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from threadpitch import __version__, cosim, lathe
from threadpitch.cosim.values import Given
from threadpitch.fmu import BuildError, ModelError
from threadpitch.fmu.check import check_built
from threadpitch.parameters import ParameterFileError, read_assignments, read_parameters
from threadpitch.pitch import PitchError, pitch_tables
from threadpitch.run_folder import check_folder, run_document, save_run
from threadpitch.system_archive import FmuKind, build_models, build_system
from threadpitch.tables import analysis_document, printable, show_groups, show_pass
from threadpitch.trace import ColumnChoice, TraceError
from threadpitch.units import UnitError

BAD_INPUT = 2
INTERRUPTED = 130
CLOSED_PIPE = 1
DEFAULT_OUTPUT = "threadpitch-run"
_KNOWN_ERRORS = (cosim.CosimError, lathe.LatheError, BuildError, ModelError, ParameterFileError, PitchError, TraceError,
                 UnitError, OSError)
# Options that take several values, and what a value looks like
_SEVERAL = {"--start-angle": r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", "--set": r"[^-=][^=]*=.*",
            "--platform": r"(linux|win|darwin)(64|-arm64)|(x86_64|aarch64)-[a-z]+"}


def _number(text: str) -> float:
    """The finite number that a text states."""
    try:
        value = float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a number; write it like 0.5") from None
    if not math.isfinite(value):
        raise typer.BadParameter(f"{text!r} is not finite; give a number like 0.5")
    return value


app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  context_settings={"help_option_names": ["-h", "--help"]},
                  help="Did the machine tool cut this thread's pitch right, and if not, why? Movement of the feed per "
                       "spindle revolution, from a simulated lathe of FMUs or from a machine's log.")

StartAngles = Annotated[list[float] | None, typer.Option(
    "--start-angle", metavar="DEG ...", parser=_number,
    help="Start angles theta_S in degrees, several after one another.")]
Flavor = Annotated[str | None, typer.Option(
    metavar="native|python", help="Kind of FMUs that are built: native code, or Python by PythonFMU.",
    show_default="native where a C compiler is found")]
AsJson = Annotated[bool, typer.Option(
    "--json", metavar="", help="Print one JSON document on standard output (mm, degrees, s).")]


@app.command()
def run(
    system: Annotated[str, typer.Argument(
        metavar="SYSTEM", help="Folder with SystemStructure.ssd, an .ssd or an .ssp.")] = lathe.DEFAULT_SYSTEM,
    assignments: Annotated[list[str] | None, typer.Option(
        "--set", metavar="NAME=VALUE ...", help="Set component.variable, several after one another: SI, or with a "
                                                "unit such as 10mm, 300rpm, 45deg; choices by name.")] = None,
    parameters: Annotated[list[Path] | None, typer.Option(
        metavar="FILE", help="Parameter file: .ssv, .toml or .json; --set wins over it.")] = None,
    start_angle: StartAngles = None,
    stop_time: Annotated[float | None, typer.Option(
        metavar="S", parser=_number, help="Stop time in s.", show_default="of the system")] = None,
    step_size: Annotated[float | None, typer.Option(
        metavar="S", parser=_number, help="Communication step in s.", show_default="what the FMUs recommend")] = None,
    flavor: Flavor = None,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for trace.csv, pitch.csv, tables.txt and "
                                                             "result.json.")] = Path(DEFAULT_OUTPUT),
    as_json: AsJson = False,
) -> None:
    """Simulate a lathe that cuts a thread, and print the movement per revolution."""
    check_folder(output)
    values: dict[str, Given] = {}
    for file in parameters or []:
        values |= read_parameters(file)
    values |= read_assignments(assignments or [])
    angles = None if start_angle is None else _radians(start_angle)
    try:
        with _progress("simulating") as progress:
            simulation = lathe.simulate(system, parameters=values, start_angles=angles, stop_time=stop_time,
                                        step_size=step_size, flavor=flavor, progress=progress)
    except cosim.SimulationInterrupted as interrupt:
        _keep(interrupt, output, lathe.choose_flavor(flavor))
    if simulation.calculators and not simulation.passes:
        _fail(simulation.why_no_turn())
    saved = save_run(simulation, output)
    with _printing():
        if as_json:
            _print_json(run_document(simulation))
        else:
            _show(simulation, saved)
    for warning in simulation.result.warnings:
        _complain(f"warning: {warning}")


@app.command()
def analyze(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Log of a machine: CSV, plain or .gz.")],
    angle: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the spindle's angle.")],
    position: Annotated[str, typer.Option(metavar="COLUMN", help="Column of the feed's position.")],
    angle_unit: Annotated[str, typer.Option(metavar="rev|deg|rad|count", help="Unit of the angle.")] = "rev",
    position_unit: Annotated[str, typer.Option(metavar="mm|m|um|inch", help="Unit of the position.")] = "mm",
    counts_per_turn: Annotated[float | None, typer.Option(
        metavar="N", parser=_number,
        help="Counts per turn, for --angle-unit count: lines of the encoder times 4.")] = None,
    group: Annotated[str | None, typer.Option(
        metavar="COLUMN", help="Column that parts the passes; rows with 0, false or nothing in it are left out.")]
    = None,
    time: Annotated[str | None, typer.Option(metavar="COLUMN", help="Column of the time.", show_default="by its name")]
    = None,
    start_angle: StartAngles = None,
    as_json: AsJson = False,
) -> None:
    """Movement per revolution of every pass in a machine's log."""
    choice = ColumnChoice(angle, position, angle_unit, position_unit, group, time, counts_per_turn)
    groups = pitch_tables(log, choice, _radians(start_angle or [0.0]))
    with _printing():
        if as_json:
            _print_json(analysis_document(groups))
        else:
            show_groups(Console(), groups)


@app.command()
def build(
    models: Annotated[list[Path] | None, typer.Argument(
        metavar="MODEL.py", help="Model files.", show_default="all of fmu_src, and the lathe as an .ssp")] = None,
    flavor: Flavor = None,
    fmi: Annotated[int, typer.Option(metavar="2|3", help="FMI version; 3 for native FMUs.")] = 2,
    platform: Annotated[list[str] | None, typer.Option(
        metavar="NAME ...", help="Platforms of native FMUs, several after one another: linux64, win64, darwin64, "
                                 "linux-arm64, darwin-arm64.", show_default="this machine")] = None,
    check: Annotated[bool, typer.Option(
        "--check", metavar="", help="Run every built FMU against its reference results.")] = False,
    output: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the FMUs.")] = Path("fmus"),
) -> None:
    """Build FMUs from model files."""
    if output.exists() and not output.is_dir():
        _fail(f"{output} is not a folder; choose another folder with --output")
    kind = FmuKind(lathe.choose_flavor(flavor), fmi, tuple(platform) if platform else None)
    built = build_models(models or lathe.model_files(), output, kind)
    problems = [problem for path in built for problem in check_built(path)] if check else []
    if problems:
        _fail(f"{problems[0]}" + (f" (and {len(problems) - 1} more)" if problems[1:] else ""))
    if not models and fmi == 2:
        built.append(build_system(lathe.DEFAULT_SYSTEM, output, kind))
    with _printing():
        print(*built, sep="\n")
        if check:
            print("all agree with their reference results")


@app.callback(invoke_without_command=True)
def _options(version: Annotated[bool, typer.Option(
        "--version", metavar="", help="Print the version.")] = False) -> None:
    if version:
        with _printing():
            print(f"threadpitch {__version__}")
        raise typer.Exit


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave the process: 0, 2 for bad input (one line on standard error), 130 after Ctrl-C."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # file names may hold what the terminal's encoding does not
    status = invoke(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    # Without the destructors of loaded libraries: PythonFMU's, which glibc keeps, touches memory that is already freed.
    os._exit(status)


def invoke(arguments: Sequence[str]) -> int:
    """The command line's exit status; what is wrong goes to standard error in one line."""
    # Not app(): what that does with Ctrl-C and closed pipes differs from version to version.
    try:
        with typer.main.get_command(app).make_context("threadpitch", _one_value_each(arguments)) as context:
            context.command.invoke(context)
    except typer.Exit as end:
        return end.exit_code
    except typer.TyperException as error:
        return _complain(_usage(error))
    except _KNOWN_ERRORS as error:
        return _complain(_file_message(error) if isinstance(error, OSError) else str(error))
    except KeyboardInterrupt:
        _complain("interrupted")
        return INTERRUPTED
    return 0


def _one_value_each(arguments: Sequence[str]) -> list[str]:
    """``--start-angle 0 90`` as ``--start-angle 0 --start-angle 90``: several values may follow one option."""
    expanded: list[str] = []
    option = ""
    for number, argument in enumerate(arguments):
        if argument == "--":
            return [*expanded, *arguments[number:]]
        follows = bool(option) and re.fullmatch(_SEVERAL[option], argument) is not None
        if follows and expanded[-1] != option:
            expanded.append(option)
        elif not follows:
            name = argument.partition("=")[0]
            option = name if name in _SEVERAL else ""
        expanded.append(argument)
    return expanded


def _radians(degrees: Sequence[float]) -> list[float]:
    for angle in degrees:
        if not abs(angle) <= 360.0:
            _fail(f"start angle {angle:g} degrees is more than a turn; give angles from -360 to 360")
    return [math.radians(angle) for angle in degrees]


class _progress:  # noqa: N801 -- used as a function: with _progress("simulating") as progress
    """A bar on standard error while the master tells (steps done, steps in all); nothing where that is no terminal."""

    def __init__(self, label: str) -> None:
        console = Console(stderr=True)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
                             TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(label, total=None)

    def __enter__(self) -> Callable[[int, int], None]:
        self._bar.start()
        return lambda done, steps: self._bar.update(self._task, completed=done, total=steps)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


@contextlib.contextmanager
def _printing() -> Iterator[None]:
    """While something is printed: whoever reads it may have gone (``| head``), or its disk may be full."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        # What is left goes nowhere: Python would write it once more, and complain, when the process ends.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(CLOSED_PIPE) from None
        _fail(f"standard output cannot be written ({error.strerror or error})")


def _show(simulation: lathe.Simulation, saved: Sequence[Path]) -> None:
    console = Console()
    for one in simulation.passes:
        show_pass(console, one)
        console.print()
    if not simulation.calculators:
        console.print(simulation.why_no_turn())
    simulated = float(simulation.time[-1] - simulation.time[0])
    print(f"{simulation.steps} steps, {simulated:g} s simulated in {simulation.wall_time:.2f} s with "
          f"{simulation.flavor} FMUs\nsaved in {saved[0].parent}: {', '.join(path.name for path in saved)}")


def _keep(interrupt: cosim.SimulationInterrupted, output: Path, flavor: str) -> NoReturn:
    """What was recorded before Ctrl-C is saved."""
    kept = ""
    if interrupt.result is not None:
        kept = f"; what was recorded is in {save_run(lathe.Simulation(interrupt.result, flavor), output)[0].parent}"
    _complain(f"{interrupt}{kept}")
    raise typer.Exit(INTERRUPTED)


def _print_json(document: dict[str, object]) -> None:
    print(json.dumps(document, allow_nan=False))


def _file_message(error: OSError) -> str:
    if error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror.lower()}" if error.filename else error.strerror


def _usage(error: typer.TyperException) -> str:
    """What is wrong with the arguments, and where their help is, unless the message itself tells how to mend it."""
    message = error.format_message().rstrip(".") or "a command is missing"
    context = getattr(error, "ctx", None)
    return message if ";" in message else f"{message}; see {context.command_path if context else 'threadpitch'} --help"


def _fail(message: str) -> NoReturn:
    raise lathe.LatheError(message)


def _complain(message: str) -> int:
    """One line on standard error, without control characters that a file may have brought in."""
    print(f"threadpitch: {printable(' '.join(message.split()))}", file=sys.stderr)
    return BAD_INPUT
