"""``threadpitch approach``: the room that a thread needs, or the highest spindle speed that the room allows."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from threadpitch import lathe
from threadpitch.approach import FANUC_TIME_CONSTANT, ApproachError, Machine, Room, fanuc_room, highest_speed
from threadpitch.cli.options import AsJson, Flavor, quantity
from threadpitch.cli.printing import fail, print_json, printing, remark
from threadpitch.parameters import read_assignments, read_parameters
from threadpitch.units import from_si

_METRE, _SPEED = "m", "rad/s"


def approach(
    lead: Annotated[str, typer.Option(metavar="LENGTH", help="Lead of the thread: 1.5mm.")],
    pitch_limit: Annotated[str, typer.Option(
        metavar="LENGTH", help="Largest error of the movement per turn: 5um.")],
    speed: Annotated[str | None, typer.Option(
        metavar="SPEED", help="Spindle speed, such as 500rpm: the approach and run-out that it needs.",
        show_default=False)] = None,
    room: Annotated[str | None, typer.Option(
        "--approach", metavar="LENGTH", help="Approach that there is, such as 3mm: the highest spindle speed.",
        show_default=False)] = None,
    system: Annotated[str, typer.Option(
        metavar="SYSTEM", help="The machine: a lathe as for run.")] = lathe.DEFAULT_SYSTEM,
    assignments: Annotated[list[str] | None, typer.Option(
        "--set", metavar="NAME=VALUE ...", help="The machine's parameters, as for run.")] = None,
    parameters: Annotated[list[Path] | None, typer.Option(
        metavar="FILE", help="Parameter file of the machine, as for run.")] = None,
    flavor: Flavor = None,
    as_json: AsJson = False,
) -> None:
    """Least approach and run-out of a thread, or the highest spindle speed: by formula and by simulation."""
    if (speed is None) == (room is None):
        fail("give either --speed, for the approach that it needs, or --approach, for the highest speed")
    values = {name: value for file in parameters or [] for name, value in read_parameters(file).items()}
    values |= read_assignments(assignments or [])
    length, limit = quantity(lead, _METRE, "--lead"), quantity(pitch_limit, _METRE, "--pitch-limit")
    machine = Machine(system, {**values, "controller.lead": length}, flavor)
    if speed is not None:
        _needed_room(machine.at(quantity(speed, _SPEED, "--speed")), limit, as_json)
    else:
        _possible_speed(machine, limit, quantity(room or "", _METRE, "--approach"), as_json)


def _needed_room(machine: Machine, limit: float, as_json: bool) -> None:
    start = machine.start
    if start.speed > machine.largest_speed:
        _too_fast(machine)
    found = {
        "manual": fanuc_room(start.lead, start.speed, limit / start.lead),
        "formula": start.room(limit),
        "simulation": machine.simulated_room(limit),
    }
    with printing():
        if as_json:
            print_json({**_question(machine, limit), "speed_rpm": from_si(start.speed, "rpm"), **{
                name: {"approach_mm": from_si(one.approach, "mm"), "run_out_mm": from_si(one.run_out, "mm")}
                for name, one in found.items()}})
            return
        table = _table(f"Room for a lead of {_mm(start.lead)} mm at {from_si(start.speed, 'rpm'):.6g} rpm, "
                       f"pitch within {from_si(limit, 'um'):.4g} um", "approach\nmm", "run-out\nmm")
        for name, one in found.items():
            table.add_row(_TITLES[name], *_row(one))
        Console().print(table)


def _possible_speed(machine: Machine, limit: float, room: float, as_json: bool) -> None:
    lead, most = machine.start.lead, machine.largest_speed
    found = {
        "manual": highest_speed(lambda at: fanuc_room(lead, at, limit / lead).approach, room, most),
        "formula": highest_speed(lambda at: machine.start_at(at).room(limit).approach, room, most),
    }
    # far from what the formula allows a simulation only takes longer
    found["simulation"] = highest_speed(lambda at: _simulated(machine.at(at), limit), room,
                                        min(most, 2.0 * found["formula"]), 0.25 * found["formula"])
    with printing():
        if as_json:
            print_json({**_question(machine, limit), "approach_mm": from_si(room, "mm"),
                        **{name: {"speed_rpm": from_si(one, "rpm")} for name, one in found.items()}})
            return
        table = _table(f"Highest speed for a lead of {_mm(lead)} mm from an approach of {_mm(room)} mm, pitch within "
                       f"{from_si(limit, 'um'):.4g} um", "speed\nrpm")
        for name, one in found.items():
            table.add_row(_TITLES[name], f"{from_si(one, 'rpm'):.0f}")
        Console().print(table)


_TITLES = {
    "manual": f"Fanuc manual, T1 = {FANUC_TIME_CONSTANT * 1e3:.1f} ms",
    "formula": "this machine's start, by formula",
    "simulation": "this machine, simulated",
}


def _simulated(machine: Machine, limit: float) -> float:
    """The simulated approach, m; of a speed at which the pitch never comes within the limit, infinite."""
    try:
        return machine.simulated_room(limit).approach
    except ApproachError:
        return math.inf


def _too_fast(machine: Machine) -> None:
    remark(f"warning: {_mm(machine.start.lead)} mm a turn at {from_si(machine.start.speed, 'rpm'):.6g} rpm is more "
           f"than the Z axis does; turn at most {from_si(machine.largest_speed, 'rpm'):.0f} rpm")


def _question(machine: Machine, limit: float) -> dict[str, object]:
    return {"lead_mm": from_si(machine.start.lead, "mm"), "pitch_limit_um": from_si(limit, "um")}


def _table(title: str, *headings: str) -> Table:
    table = Table(title=title, box=box.ASCII2)
    table.add_column("by", no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _row(room: Room) -> tuple[str, str]:
    return f"{from_si(room.approach, 'mm'):.3f}", f"{from_si(room.run_out, 'mm'):.3f}"


def _mm(value: float) -> str:
    return f"{from_si(value, 'mm'):.6g}"
