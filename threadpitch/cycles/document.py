"""A cycle as people and programs read it: JSON document, table, canonical moves as text. mm, X as diameter, degrees."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.table import Table

from threadpitch.cycles.interpreter import Interpretation
from threadpitch.cycles.moves import Move, Pass, move_text
from threadpitch.cycles.pass_kinds import hands
from threadpitch.units import from_si

LEADS_IN_TITLE = 3
DECIMALS = 9  # of mm and degrees: far below any machine, above the rounding of the arithmetic


def cycle_document(interpretation: Interpretation) -> dict[str, object]:
    """``{"passes": [...], "parameters": {"019": ...}}``; depth as radius, null where the words tell none (G32, G92).

    The hand of the thread is right or left, null across a face.
    """
    return {
        "passes": [{**pass_record(cut), "hand": hand} for cut, hand in zip(
            interpretation.passes, hands(interpretation.passes, interpretation.moves), strict=True)],
        "parameters": dict(interpretation.parameters.by_number()),
    }


def pass_record(cut: Pass) -> dict[str, object]:
    """One pass as a JSON object: X as diameter, mm, degrees."""
    return {
        "number": cut.number,
        "kind": cut.kind,
        "depth_mm": None if cut.depth is None else millimetres(cut.depth),
        "start_x_mm": millimetres(2.0 * cut.start.x),
        "start_z_mm": millimetres(cut.start.z),
        "end_x_mm": millimetres(2.0 * cut.end.x),
        "end_z_mm": millimetres(cut.end.z),
        "start_angle_deg": degrees(cut.start_angle),
    }


def cycle_table(passes: Sequence[Pass], moves: Iterable[Move] = ()) -> Table:
    """The passes as a table of 80 characters; the leads stand in its title, and the hand where it is left."""
    leads = sorted({millimetres(cut.lead) for cut in passes})
    named = ", ".join(f"{lead:.4f}" for lead in leads[:LEADS_IN_TITLE])
    more = ", ..." if len(leads) > LEADS_IN_TITLE else ""
    found = set(hands(passes, moves))
    hand = "" if "left" not in found else ", left-hand" if found == {"left"} else ", right- and left-hand"
    table = Table(title=f"Threading passes, lead {named}{more} mm{hand}", box=box.ASCII2)
    table.add_column("pass", justify="right", no_wrap=True)
    table.add_column("kind", no_wrap=True)
    for heading in ("depth\nmm", "start X\nmm", "start Z\nmm", "end X\nmm", "end Z\nmm", "angle\ndeg"):
        table.add_column(heading, justify="right", no_wrap=True)
    for cut in passes:
        places = (2.0 * cut.start.x, cut.start.z, 2.0 * cut.end.x, cut.end.z)
        depth = "-" if cut.depth is None else f"{millimetres(cut.depth):.4f}"
        texts = (f"{millimetres(value):.4f}" for value in places)
        table.add_row(str(cut.number), cut.kind, depth, *texts, f"{degrees(cut.start_angle):.3f}")
    return table


def moves_text(moves: Iterable[Move]) -> str:
    """The canonical moves, one per line, each after its program line."""
    return "".join(f"{move.line:4d}  {move_text(move).rstrip()}\n" for move in moves)


def millimetres(value: float) -> float:
    """m -> mm without the rounding error of the conversion, and without a signed zero."""
    return round(from_si(value, "mm"), DECIMALS) + 0.0


def degrees(value: float) -> float:
    """rad -> degrees, likewise."""
    return round(from_si(value, "deg"), DECIMALS) + 0.0
