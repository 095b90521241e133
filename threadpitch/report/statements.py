"""What a report says of a thread in words and figures: the tables, the verdict with its evidence, tolerances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from threadpitch.judgement import Evidence
from threadpitch.pitch import Statistics, statistics
from threadpitch.report.content import Thread
from threadpitch.tables import printable, start_angles_deg
from threadpitch.tolerance import PitchConformity
from threadpitch.units import from_si

MISSING = "-"
_DECIMALS = 4  # of a millimetre


@dataclass(frozen=True)
class TextTable:
    """A table as people read it: a heading, the names of the columns, rows of text."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Statements:
    """All that is said of a thread."""

    name: str
    lines: tuple[str, ...]
    tables: tuple[TextTable, ...]
    verdict: str  # empty where there is none
    cause: str
    advice: tuple[str, ...]
    evidence: tuple[tuple[str, str], ...]
    tolerances: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    provenance: tuple[tuple[str, str], ...]


def statements(thread: Thread) -> Statements:
    """The words and figures of a thread."""
    verdict = thread.verdict
    return Statements(
        printable(thread.name), tuple(printable(line) for line in thread.lines), tuple(_tables(thread)),
        "" if verdict is None else printable(verdict.sentence), "" if verdict is None else verdict.cause,
        () if verdict is None else tuple(printable(line) for line in verdict.advice),
        () if verdict is None else tuple(_evidence(verdict.evidence)),
        tuple((printable(name), _conformity(one)) for name, one in thread.tolerances),
        tuple(printable(note) for note in (*thread.notes, *(() if verdict is None else verdict.notes))),
        tuple((printable(name), printable(text)) for name, text in thread.provenance))


def _tables(thread: Thread) -> list[TextTable]:
    """Table 1 and 2 of the seed for one start angle, 3 and 4 for several; then those of the thread proper."""
    table = thread.nominal
    names = [f"theta_S{row + 1} = {angle:.6g} deg" for row, angle in enumerate(start_angles_deg(table))]
    rows = [(str(360 * (turn + 1 + table.turns_before)), str(turn + 1),
             *(_mark(thread, row, turn) for row in range(len(names)))) for turn in range(table.pitch.shape[1])]
    several = len(names) > 1
    found = [TextTable(f"Table {'3' if several else '1'}: movement per revolution P(n) [mm]",
                       ("Rotation angle [deg]", "n", *names), tuple(rows)),
             _statistics(f"Table {'4' if several else '2'}: over all turns [mm]", names, table.statistics)]
    if (thread.chosen != ~np.isnan(table.pitch)).any():
        first, last = thread.first_and_last
        proper = statistics(np.where(thread.chosen, table.pitch, np.nan))
        found.append(_statistics(f"The same over the thread proper, turns {first} to {last} [mm]", names, proper))
    if thread.others is not None and len(thread.others.rows) > 1:
        found.append(TextTable("All passes, every one over its thread proper [mm]",
                               ("Pass", "Minimum", "Maximum", "Mean"),
                               tuple((printable(name), *(_mm(value) for value in values))
                                     for name, *values in thread.others.rows)))
    return found


def _statistics(heading: str, names: list[str], found: Statistics) -> TextTable:
    rows = tuple((name, _mm(float(found.maximum[row])), _mm(float(found.minimum[row])), _mm(float(found.mean[row])))
                 for row, name in enumerate(names))
    return TextTable(heading, ("Start angle", "Maximum", "Minimum", "Mean"), rows)


def _mark(thread: Thread, row: int, turn: int) -> str:
    """A pitch; in brackets outside of the thread proper, with a star where it was extrapolated."""
    pitch = float(thread.nominal.pitch[row, turn])
    text = _mm(pitch)
    if math.isnan(pitch):
        return text
    if thread.nominal.extrapolated[row] and (turn == 0 or math.isnan(thread.nominal.pitch[row, turn - 1])):
        text += "*"
    return text if thread.chosen[row, turn] else f"({text})"


def _mm(value: float) -> str:
    return MISSING if math.isnan(value) else f"{from_si(value, 'mm'):.{_DECIMALS}f}"


def _evidence(found: Evidence) -> list[tuple[str, str]]:
    rows = [("Turns in both tables", str(found.turns)),
            ("Fluctuation, root mean square", _um(found.fluctuation)), ("Largest deviation", _um(found.largest)),
            ("Standard uncertainty of one measured pitch", _um(found.uncertainty))]
    for name, value, interval in (("Gain", found.gain, found.gain_interval),
                                  ("Correlation", found.correlation, found.correlation_interval)):
        if value is not None and interval is not None:
            rows.append((name, f"{value:.3f} ({interval[0]:.3f} to {interval[1]:.3f})"))
    if found.permutation_p is not None:
        rows.append(("Permutation test", f"p = {found.permutation_p:.4f}"))
    if found.sign_agreement is not None:
        rows.append(("Turns on the same side of the target", f"{100.0 * found.sign_agreement:.0f} %"))
    rows += [("Share of the control", f"{100.0 * found.control_share:.0f} %"),
             ("Share of the rest", f"{100.0 * found.rest_share:.0f} %")]
    rows += [("Part of the rest", printable(str(part))) for part in found.rest]
    within = "not observable from P(n)" if found.within_turn is None else f"{_um(found.within_turn)} (nominal)"
    return [*rows, ("Error within the turn that repeats", within)]


def _conformity(found: PitchConformity) -> str:
    first, last = found.cumulative_turns
    return (f"{found.verdict.capitalize()}: cumulative deviation {_um(found.cumulative)} (turns {first} to {last}) "
            f"+- {_um(found.expanded_uncertainty)}, limit {_um(found.limit)}; "
            f"{100.0 * found.cumulative_share:.1f} % of the pitch-diameter tolerance of {_um(found.tolerance)}")


def _um(length: float) -> str:
    return f"{from_si(length, 'um'):.4g} um"
