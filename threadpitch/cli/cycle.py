"""``threadpitch cycle``: the passes of a threading cycle or of a whole program, as a table, as JSON and drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from threadpitch import cycles
from threadpitch.cli.options import (
    AsJson,
    Dialect,
    Increments,
    Starts,
    Waiting,
    increment_system,
    indexing,
    number,
)
from threadpitch.cli.printing import fail, print_json, printing, remark
from threadpitch.report.cycle_plot import plot_cycle
from threadpitch.units import from_si, to_si

AXIS_SPEED = 30.0  # m/min, of the shipped feed drives
TABLE_WIDTH = 80


def cycle(
    blocks: Annotated[list[str] | None, typer.Argument(
        metavar="BLOCK ...", help="Blocks of the cycle, each in quotes: 'G76 P020560 Q0.15 R0.1' "
                                  "'G76 X60.64 Z-62 P3.68 Q1.8 F6'.", show_default=False)] = None,
    program: Annotated[Path | None, typer.Option(
        metavar="FILE", help="A whole program instead of blocks.")] = None,
    at: Annotated[str | None, typer.Option(
        metavar="X,Z", help="Start point in mm, X as diameter.", show_default="clear of an external thread")] = None,
    dialect: Dialect = cycles.TOMATECH.name,
    increments: Increments = cycles.IncrementSystem.IS_B.value,
    starts: Starts = 1,
    wait: Waiting = "once",
    speed: Annotated[float | None, typer.Option(
        metavar="RPM", parser=number, help="Spindle speed, where the blocks have no S.")] = None,
    axis_speed: Annotated[float, typer.Option(
        metavar="M/MIN", parser=number, help="Largest feed of an axis; a warning tells which pass exceeds "
                                             "it.")] = AXIS_SPEED,
    parameters: Annotated[Path | None, typer.Option(
        "--parameters", "--control", metavar="FILE",
        help="The control's parameters 019, 057 to 060, 106, 253; what the cycle rewrites is kept there.")] = None,
    moves: Annotated[bool, typer.Option(
        "--moves", metavar="", help="Print the canonical moves instead of the passes.")] = False,
    plot: Annotated[Path | None, typer.Option(
        metavar="FILE", help="Draw infeed scheme and tool path: .svg, .png or .pdf.")] = None,
    as_json: AsJson = False,
) -> None:
    """The passes of a threading cycle: depth, start and end of every pass in mm (X as diameter), start angle."""
    if (program is None) == (not blocks):
        fail("give either the blocks of a cycle, each in quotes, or --program FILE")
    kept = cycles.ParameterFile(parameters) if parameters is not None else None
    setup = cycles.Setup(
        dialect=cycles.dialect_named(dialect), increments=increment_system(increments), starts=starts,
        indexing=indexing(wait), parameters=kept.read() if kept else cycles.ControlParameters(),
        position=cycles.start_point(at) if at is not None else None,
        spindle_speed=None if speed is None else _turning(speed))
    if program is not None:
        result = cycles.interpret(cycles.read_program_file(program), setup)
        if not result.passes:
            fail(f"{program}: the program cuts no thread; it needs G32, G33, G34, G76 or G92")
    else:
        result = cycles.expand_cycle(blocks or [], setup)
    if plot is not None:
        plot_cycle(result, plot)
    if kept is not None:
        result = replace(result, parameters=kept.rewrite(result.rewritten))
    with printing():
        if as_json:
            print_json(cycles.cycle_document(result))
        elif moves:
            print(cycles.moves_text(result.moves), end="")
        else:
            _show(result)
    for notice in result.notices:
        remark(f"note: {notice}")
    _warn_of_fast_passes(result, setup.spindle_speed, to_si(axis_speed, "m/min"))


def _turning(speed: float) -> float:
    if not speed > 0.0:
        fail(f"a spindle speed of {speed:g} rpm cuts no thread; give a positive one")
    return to_si(speed, "rpm")


def _show(result: cycles.Interpretation) -> None:
    console = Console(width=max(TABLE_WIDTH, Console().width))
    console.print(cycles.cycle_table(result.passes, result.moves))
    final = cycles.final_flank(result.passes)
    if len(final) == 1:
        console.print(f"Pass {final[0]} makes the final flank.")
    else:
        console.print(f"Passes {', '.join(map(str, final))} make the final flanks.")


def _warn_of_fast_passes(result: cycles.Interpretation, standing: float | None, limit: float) -> None:
    """The first pass that needs more than ``limit`` (m/s) of an axis, and the spindle speed that would do."""
    spindle = cycles.spindle_of_passes(result.moves)
    for cut in result.passes:
        commanded = spindle.get(cut.number)
        speed = standing if commanded is None else cycles.turning_speed(commanded, cut)
        feed = 0.0 if speed is None else cycles.largest_feed(cut, speed)
        if speed is not None and feed > limit:
            remark(f"warning: pass {cut.number} needs {from_si(feed, 'm/min'):.4g} m/min of an axis that does "
                   f"{from_si(limit, 'm/min'):.4g}; turn at most {from_si(speed * limit / feed, 'rpm'):.0f} rpm")
            return
