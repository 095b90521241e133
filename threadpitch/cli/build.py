"""``threadpitch build``: FMUs from model files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from threadpitch import lathe
from threadpitch.cli.options import Flavor
from threadpitch.cli.printing import chosen_flavor, fail, printing, remark
from threadpitch.fmu import read_model, refusal
from threadpitch.fmu.check import check_built
from threadpitch.system_archive import FmuKind, build_models, build_system


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
        fail(f"{output} is not a folder; choose another folder with --output")
    kind = FmuKind(chosen_flavor(flavor), fmi, tuple(platform) if platform else None)
    paths = models or lathe.model_files()
    built = build_models(paths, output, kind)
    for path in paths:
        refused = refusal(read_model(path))
        if refused is not None:
            remark(f"warning: {refused}")
    problems = [problem for path in built for problem in check_built(path)] if check else []
    if problems:
        fail(f"{problems[0]}" + (f" (and {len(problems) - 1} more)" if problems[1:] else ""))
    if not models and fmi == 2:
        built.append(build_system(lathe.DEFAULT_SYSTEM, output, kind))
    with printing():
        print(*built, sep="\n")
        if check:
            print("all agree with their reference results")
