"""What options of several commands share: how values are read, and which options take several."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from threadpitch import cycles, lathe
from threadpitch.units import UnitError, conversion

_RECORDED = r"outputs|inputs|locals|parameters|\*|(?!.*\.ss[dp]$)[^-/\\][^/\\]*\.[^/\\]*"
# Options that take several values, and what a value looks like
SEVERAL = {
    "--start-angle": r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)",
    "--set": r"[^-=][^=]*=.*",
    "--known": r"[^-=][^=]*=.*",
    "--free": r"[a-z]\w*",
    "--replace": r"[^-=][^=]*=.*",
    "--record": _RECORDED,
    "--record-on": _RECORDED,
    "--measure": r"[^-=][^=]*=.*",
    "--multiple": r"[^-=][^=]*=.*",
    "--event": r"[^-=][^=]*=.*",
    "--isolate": r"[^-/\\.][^/\\.]*",
    "--platform": r"(linux|win|darwin)(64|-arm64)|(x86_64|aarch64)-[a-z]+",
}

# Why an option would do nothing
WITHOUT_MEASURED = "belongs to measured pitches; give them with --measured FILE, or leave it out"
WITHOUT_THREAD = "belongs to the tolerance of a thread; give it with --thread like M20x1.5-6g, or leave it out"
OF_THREAD = ("limit", "engagement")

STORE = "--store"
# What may follow --store; anything else is the next argument, as in `threadpitch run --store models/threading_lathe`
KEEPERS = ("run", "resume", "analyze", "watch", "study")  # whose --store may stand alone; elsewhere it names the store
ADDRESS = r"default|[a-z+]+://.*|[^-].*\.(db|sqlite3?)"


def number(text: str) -> float:
    """The finite number that a text states."""
    try:
        value = float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a number; write it like 0.5") from None
    if not math.isfinite(value):
        raise typer.BadParameter(f"{text!r} is not finite; give a number like 0.5")
    return value


def quantity(text: str, target: str, option: str) -> float:
    """A positive quantity with its unit ("1.5mm", "500rpm"), in SI; ``target`` is the SI unit.

    Raises:
        LatheError: no number, no unit, a unit of something else, or not positive.
    """
    match = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", text)
    example = {"m": "1.5mm", "rad/s": "500rpm"}[target]
    if match is None or not match[2]:
        raise lathe.LatheError(f"{option} {text!r} is not a number with a unit; write it like {example}")
    try:
        factor, offset = conversion(match[2], target)
    except UnitError as error:
        raise lathe.LatheError(f"{option} {text!r}: {error}; write it like {example}") from None
    value = float(match[1]) * factor + offset
    if not 0.0 < value < math.inf:
        raise lathe.LatheError(f"{option} {text!r} is not positive; write it like {example}")
    return value


StartAngles = Annotated[list[float] | None, typer.Option(
    "--start-angle", metavar="DEG ...", parser=number,
    help="Start angles theta_S in degrees, several after one another.")]
Assignments = Annotated[list[str] | None, typer.Option(
    "--set", metavar="NAME=VALUE ...", help="Set component.variable, several after one another: SI, or with a "
                                            "unit such as 10mm, 300rpm, 45deg; choices by name.")]
ParameterFiles = Annotated[list[Path] | None, typer.Option(
    "--parameters", metavar="FILE", help="Parameter file: .ssv, .toml or .json; --set wins over it.")]
Replacements = Annotated[list[str] | None, typer.Option(
    metavar="NAME=FILE ...", help="Run another FMU, or a model file (.py), as this component.")]
Dialect = Annotated[str, typer.Option(
    "--dialect", metavar="NAME", help=f"Control that the program is written for: {', '.join(cycles.DIALECTS)}.")]
Starts = Annotated[int, typer.Option(
    "--starts", metavar="N", min=1, max=100, help="Starts of a thread by G76: pitch = lead / N.")]
Waiting = Annotated[str, typer.Option(
    "--wait", metavar="once|every-block", help="What a chain of threading blocks waits for: the first block for its "
                                               "start angle, or every block for its own (special grooves).")]
Measure = Annotated[list[str] | None, typer.Option(
    "--measure", metavar="NAME=VALUE ...",
    help="Measure the thread that was cut, with errors of its own, into measured.csv, and judge that: "
         "uncertainty=1um of one pitch, every=1 (so many-th turn), points=4 around it, "
         "flanks=both|negative_z|positive_z|middle, seed=0.")]
Increments = Annotated[str, typer.Option(
    "--increments", metavar="IS-B|IS-C", help="Least input increment of the program: 0.001 or 0.0001 mm.")]
Control = Annotated[Path | None, typer.Option(
    "--control", metavar="FILE", help="The control's parameters 019, 057 to 060, 106, 253 for --program; what it "
                                      "rewrites is kept there.")]
Flavor = Annotated[str | None, typer.Option(
    metavar="native|python", help="Kind of FMUs that are built: native code, or Python by PythonFMU.",
    show_default="native where a C compiler is found")]
Workers = Annotated[int | None, typer.Option(
    metavar="N", min=0, help="Processes of a local Dask cluster; 0: this process, without Dask.",
    show_default="one for each core")]
Scheduler = Annotated[str | None, typer.Option(
    metavar="ADDRESS", help="Dask scheduler that runs already, such as tcp://host:8786.")]
AsJson = Annotated[bool, typer.Option(
    "--json", metavar="", help="Print one JSON document on standard output (mm, degrees, s).")]


def refuse(context: typer.Context, parameters: Iterable[str], why: str) -> None:
    """Parameters of a command that would do nothing as it is called.

    Raises:
        LatheError: one of them was written on the command line.
    """
    names = {one.name: one.opts[0] for one in context.command.params}
    for parameter in parameters:
        source = context.get_parameter_source(parameter)
        if source is not None and source.name == "COMMANDLINE":
            raise lathe.LatheError(f"{names[parameter]} {why}")


def indexing(name: str) -> cycles.Indexing:
    """What ``--wait`` names.

    Raises:
        CycleError: it is not known.
    """
    known = {one.value.replace("_", "-"): one for one in cycles.Indexing}
    if name not in known:
        raise cycles.CycleError(f"--wait {name!r} is not known; choose {' or '.join(known)}")
    return known[name]


def increment_system(name: str) -> cycles.IncrementSystem:
    """What ``--increments`` names, with or without IS-.

    Raises:
        CycleError: it is not known.
    """
    known = {one.value: one for one in cycles.IncrementSystem}
    found = known.get(name.upper()) or known.get(f"IS-{name.upper()}")
    if found is None:
        raise cycles.CycleError(f"increment system {name!r} is not known; choose {' or '.join(known)}")
    return found


def radians(degrees: Sequence[float]) -> list[float]:
    """Start angles of the command line, rad.

    Raises:
        LatheError: one is more than a turn.
    """
    for angle in degrees:
        if not abs(angle) <= 360.0:
            raise lathe.LatheError(f"start angle {angle:g} degrees is more than a turn; give angles from -360 to 360")
    return [math.radians(angle) for angle in degrees]
