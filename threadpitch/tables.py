"""The pitch tables as people read them, and as JSON: rotation angle, rotation number, movement per rotation.

The layout is that of Tables 1 to 4 of US 2016/0008901 A1, turned by 90 degrees: turns are rows, so that a thread of
40 turns reads well, and start angles are columns; more of them than fit the width follow in tables of their own.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

from threadpitch.passes import Pass
from threadpitch.pitch import BoolArray, GroupPitch, PitchTable, Statistics, StreamedPitch
from threadpitch.sparkline import deviation_lines, pass_deviation_lines
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

MISSING = "-"
_EXTRAPOLATED = "* begins before the first sample: extrapolated from the first two samples"
_TURN_COLUMNS = 24  # characters of the columns for rotation angle and rotation number
_START_COLUMN = 12  # characters of the column of one start angle
_UNCERTAINTY_COLUMN = 9  # characters of its standard uncertainties
_NARROW = _TURN_COLUMNS + _START_COLUMN + 2  # below it the rotation angle is left out
_NARROW_STATISTICS = 56  # below it start angles are columns of the statistics
_LEAST, _GREATEST = "blue", "magenta"  # colours of a start angle's least and greatest movement


@dataclass(frozen=True)
class Layout:
    """How the tables are set: characters per line, decimals of a millimetre (4: 0.1 um), lines around the cells."""

    width: int = 80
    decimals: int = 4
    lines: box.Box = box.ASCII2


def analysis_document(groups: Sequence[GroupPitch | StreamedPitch]) -> dict[str, object]:
    """The groups of a log as a JSON document, mm and degrees; null where a crossing lies outside the log."""
    return {"groups": [{"group": group.label, **pitch_record(group.table), **_stored_record(group)}
                       for group in groups]}


def _stored_record(group: GroupPitch | StreamedPitch) -> dict[str, object]:
    points = group.stored if isinstance(group, StreamedPitch) else None
    if points is None:
        return {}
    return {"stored": {"interval_deg": round(from_si(points.interval, "deg"), 9),
                       "angle_deg": [round(from_si(angle, "deg"), 9) for angle in points.angle.tolist()],
                       "position_mm": _millimetres(points.position)}}


def pitch_record(table: PitchTable) -> dict[str, object]:
    """A table as a JSON object, mm and degrees; ``pitch_mm[k][n - 1]`` is P(n) of start angle k, null outside."""
    return {
        "start_angles_deg": start_angles_deg(table),
        "pitch_mm": [_millimetres(row) for row in table.pitch],
        "min_mm": _millimetres(table.minimum),
        "max_mm": _millimetres(table.maximum),
        "mean_mm": _millimetres(table.mean),
        "extrapolated": [bool(flag) for flag in table.extrapolated],
        **({} if table.uncertainty is None else {"uncertainty_mm": [_millimetres(row) for row in table.uncertainty]}),
        "turns_before": table.turns_before,
        "notes": list(table.notes),
    }


def start_angles_deg(table: PitchTable) -> list[float]:
    """The start angles in degrees, without the rounding error of the conversion."""
    return [round(from_si(float(angle), "deg"), 9) for angle in table.start_angles]


def pitch_tables_text(table: PitchTable, layout: Layout | None = None) -> str:
    """Table 1 and 2 (one start angle) or 3 and 4 (several) as plain text."""
    return _plain(pitch_renderable(table, layout), layout or Layout())


def show_groups(console: Console, groups: Sequence[GroupPitch | StreamedPitch], *, decimals: int = 4,
                target: float | None = None) -> None:
    """Prints the tables of every group and its deviations from the target, m, or from their median where there is none.

    With drawn lines, colours and bold heads on a terminal, plain in a pipe.
    """
    layout = _layout_of(console, decimals)
    for group in groups:
        console.print(Text(f"Group {printable(group.label)}", style="bold"))
        console.print(pitch_renderable(group.table, layout))
        for line in deviation_lines(console, group.table, target):
            console.print(line)
        console.print()


def show_pass(console: Console, one: Pass, others: Mapping[str, Pass] | None = None, *, decimals: int = 4) -> None:
    """Prints the tables and deviations of a simulated pass; drawn lines and colours on a terminal, plain in a pipe.

    Of ``others``, the same pass as other calculators saw it, the statistics follow.
    """
    console.print(_pass_renderable(one, others or {}, _layout_of(console, decimals)))
    for line in pass_deviation_lines(console, one):
        console.print(line)


def pass_text(one: Pass, others: Mapping[str, Pass] | None = None, layout: Layout | None = None) -> str:
    """The tables of a simulated pass as plain text, with the statistics of the same pass by ``others``."""
    return _plain(_pass_renderable(one, others or {}, layout or Layout()), layout or Layout())


def pass_description(one: Pass) -> str:
    """Kind, depth, start angle, lead, pitch and hand of a pass in two lines; empty where the system tells nothing."""
    if one.kind is None or one.depth is None or one.start_angle is None or one.lead is None or one.pitch is None:
        return ""
    depth, lead, pitch = (from_si(value, "mm") for value in (one.depth, one.lead, one.pitch))
    flank = ", makes the final flank" if one.final_flank else ""
    return (f"{one.kind}, depth {depth:.4f} mm{flank}\n"
            f"start angle {from_si(one.start_angle, 'deg'):.6g} deg, lead {lead:.6g} mm, pitch {pitch:.6g} mm"
            f"{'' if one.hand is None else f', {one.hand}-hand'}")


def pitch_renderable(table: PitchTable, layout: Layout | None = None) -> RenderableType:
    """The movement per rotation, then its greatest, least and mean value, for a rich console."""
    layout = layout or Layout()
    parts: list[RenderableType] = [Text("Movement amount P(n) for each rotation [mm]"),
                                   *_movement_tables(table, layout),
                                   *_statistics_tables(table, table.statistics, layout)]
    if table.uncertainty is not None:
        parts.append(Text(_uncertainty(table.uncertainty)))
    if table.extrapolated.any():
        parts.append(Text(_EXTRAPOLATED))
    parts.extend(Text(printable(note)) for note in table.notes)
    return Group(*parts)


def printable(text: str) -> str:
    """Text from a file without control characters, which a terminal would obey."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def _uncertainty(values: FloatArray) -> str:
    least, middle, most = (1e6 * float(value) for value in (np.nanmin(values), np.nanmedian(values), np.nanmax(values)))
    return f"Standard uncertainty of P(n): {middle:.3g} um ({least:.3g} to {most:.3g})"


def _movement_tables(table: PitchTable, layout: Layout) -> Iterator[Table]:
    count = table.start_angles.size
    own = _START_COLUMN + (0 if table.uncertainty is None else _UNCERTAINTY_COLUMN)
    per_table = max(1, (layout.width - _TURN_COLUMNS) // own)
    for first in range(0, count, per_table):
        columns = range(first, min(first + per_table, count))
        yield _movement_table(table, columns, layout)


def _movement_table(table: PitchTable, columns: range, layout: Layout) -> Table:
    beside = [] if table.uncertainty is None else ["u\n[um]"]
    headings = ["Rotation\nangle [deg]", "Number\nn [rev]",
                *(heading for column in columns for heading in (_heading(table, column), *beside))]
    narrow = layout.width < _NARROW
    made = _table(headings[1:] if narrow else headings, layout)
    for turn in range(table.pitch.shape[1]):
        angle = [] if narrow else [str(360 * (turn + 1 + table.turns_before))]
        cells = [cell for column in columns for cell in _cells(table, column, turn, layout.decimals)]
        made.add_row(*angle, str(turn + 1), *cells)
    return made


def _pass_renderable(one: Pass, others: Mapping[str, Pass], layout: Layout) -> RenderableType:
    """The tables, with the statistics once more over the turns that lie in the metal."""
    head = Text(f"Pass {one.number}, start {one.start_number}", style="bold")
    told = [Text(what)] if (what := pass_description(one)) else []
    parts: list[RenderableType] = [head, *told, pitch_renderable(one.table, layout)]
    if one.effective is not None and one.in_metal.any():
        parts += [Text(f"Effective thread: turns in the metal, {_in_metal(one.table, one.in_metal)}"),
                  *_statistics_tables(one.table, one.effective, layout)]
    for name, other in others.items():
        in_metal = other.effective is not None and other.in_metal.any()
        turns = f"in the metal, {_in_metal(other.table, other.in_metal)}" if in_metal else "all"
        found = other.effective if in_metal and other.effective else other.table.statistics
        parts += [Text(printable(f"By {name}: turns {turns}")), *_statistics_tables(other.table, found, layout)]
    return Group(*parts)


def _in_metal(table: PitchTable, in_metal: BoolArray) -> str:
    """The turns, of every start angle by itself where they differ."""
    ranges = []
    for row in in_metal:
        turns = np.flatnonzero(row) + 1
        ranges.append(f"n = {turns[0]} to {turns[-1]}" if turns.size else "none")
    if len(set(ranges)) == 1:
        return ranges[0]
    return "; ".join(f"{angle:.6g} deg: {turns}" for angle, turns in zip(start_angles_deg(table), ranges, strict=True))


def _layout_of(console: Console, decimals: int) -> Layout:
    return Layout(console.width, decimals, box.SIMPLE_HEAD if console.is_terminal else box.ASCII2)


def _plain(renderable: RenderableType, layout: Layout) -> str:
    text = io.StringIO()
    Console(file=text, width=layout.width, force_terminal=False, color_system=None).print(renderable)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"


def _statistics_tables(table: PitchTable, found: Statistics, layout: Layout) -> Iterator[Table]:
    """One start angle per row; on narrow paper one per column, and as many tables as it takes."""
    rows = [("Maximum", found.maximum, _GREATEST), ("Minimum", found.minimum, _LEAST), ("Mean", found.mean, "")]
    cells = {name: [Text(_number(value, layout.decimals), style=style) for value in values.tolist()]
             for name, values, style in rows}
    count = table.start_angles.size
    if layout.width >= _NARROW_STATISTICS:
        made = _table(["Start angle", *(f"{name}\n[mm]" for name in cells)], layout)
        for row in range(count):
            made.add_row(_heading(table, row).replace("\n", " = "), *(values[row] for values in cells.values()))
        yield made
        return
    per_table = max(1, layout.width // _START_COLUMN - 1)
    for first in range(0, count, per_table):
        columns = range(first, min(first + per_table, count))
        made = _table(["[mm]", *(_heading(table, column) for column in columns)], layout)
        for name, values in cells.items():
            made.add_row(name, *(values[column] for column in columns))
        yield made


def _table(headings: list[str], layout: Layout) -> Table:
    made = Table(box=layout.lines)
    for heading in headings:
        made.add_column(Text(heading), justify="right", no_wrap=True)  # Text: a bracketed unit is no markup
    return made


def _heading(table: PitchTable, column: int) -> str:
    return f"theta_S{column + 1}\n{start_angles_deg(table)[column]:.6g} deg"


def _cell(table: PitchTable, column: int, turn: int, decimals: int) -> Text:
    """The first turn that is there is the one whose beginning may be extrapolated; coloured: least and greatest."""
    pitch = float(table.pitch[column, turn])
    text = _number(pitch, decimals)
    first = table.extrapolated[column] and text != MISSING and (turn == 0 or math.isnan(table.pitch[column, turn - 1]))
    style = {float(table.minimum[column]): _LEAST, float(table.maximum[column]): _GREATEST}.get(pitch, "")
    return Text(f"{text}*" if first else text, style=style)


def _cells(table: PitchTable, column: int, turn: int, decimals: int) -> list[Text]:
    """P(n), and its standard uncertainty where that is known."""
    pitch = _cell(table, column, turn, decimals)
    if table.uncertainty is None:
        return [pitch]
    uncertainty = float(table.uncertainty[column, turn])
    return [pitch, Text(MISSING if math.isnan(uncertainty) else f"{from_si(uncertainty, 'um'):.2f}")]


def _number(value: float, decimals: int) -> str:
    return MISSING if math.isnan(value) else f"{from_si(value, 'mm'):.{decimals}f}"


def _millimetres(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(value) else from_si(value, "mm") for value in values.tolist()]
