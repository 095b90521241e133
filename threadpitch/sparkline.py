"""The deviation of the pitches in one line of text per start angle, and a verdict in one line: what a terminal shows.

    -0.53 um _-=.-=^-_=-.=  +0.47 um

A character stands for one turn, or where the line is too short, for the turn of several that is farthest off. Turns
that are far outside of what the others do (the start of the feed) are arrows, so that the others keep their scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.text import Text

from threadpitch.passes import Pass
from threadpitch.pitch import BoolArray, PitchTable, usual
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

SHORTEST = 8  # characters of a line that still shows something
_FLAT = 1e-9  # m, a fluctuation that is not worth a drawing
_STYLES = {"control": "bold yellow", "mechanical": "bold red", "both": "bold red", "none": "bold green",
           "undetermined": "bold cyan"}


@dataclass(frozen=True)
class Letters:
    """What a line is made of, from low to high."""

    levels: str
    below: str
    above: str
    missing: str = " "


BLOCKS = Letters("▁▂▃▄▅▆▇█", "↓", "↑")
PLAIN = Letters("_.,-=+*#", "v", "^")


def sparkline(values: FloatArray, width: int, letters: Letters = PLAIN) -> str:
    """The values (turns,) from least to greatest as one character each, at most ``width``; NaN is a gap."""
    known = values[~np.isnan(values)]
    if known.size == 0:
        return ""
    low, high = _range(known)
    return "".join(_letter(value, low, high, letters) for value in _farthest(values, width).tolist())


def deviation_lines(console: Console, table: PitchTable, target: float | None = None,
                    chosen: BoolArray | None = None) -> list[Text]:
    """A heading and one line per start angle: P(n) less the target, m (less their median where there is none), over n.

    ``chosen`` (start_angles, revolutions) are the turns that are looked at, such as those in the metal.
    """
    pitch = table.pitch if chosen is None else np.where(chosen, table.pitch, np.nan)
    if not (~np.isnan(pitch)).any():
        return []
    letters = BLOCKS if console.is_terminal and console.encoding.lower().startswith("utf") else PLAIN
    where = "the median" if target is None else f"{from_si(target, 'mm'):.6g} mm"
    lines = [Text(f"Deviation of P(n) from {where} over n [um]")]
    for row, angle in enumerate(table.start_angles.tolist()):
        known = np.flatnonzero(~np.isnan(pitch[row]))
        if known.size:
            deviation = pitch[row, known[0]:known[-1] + 1]
            deviation = deviation - (float(np.nanmedian(deviation)) if target is None else target)
            lines.append(_line(f"{from_si(angle, 'deg'):5.6g} deg", deviation, console.width, letters))
    return lines


def pass_deviation_lines(console: Console, one: Pass) -> list[Text]:
    """``deviation_lines`` of a simulated pass: the turns in the metal, where there are some."""
    known = ~np.isnan(one.deviation)
    if not known.any():
        return []
    chosen = one.in_metal if one.in_metal.any() else None
    if one.variable:
        return variable_deviation_lines(console, PitchTable.of_pitches(one.deviation, one.table.start_angles), chosen)
    target = float((one.table.pitch - one.deviation)[known][0])
    return deviation_lines(console, one.table, target, chosen)


def variable_deviation_lines(console: Console, deviation: PitchTable, chosen: BoolArray | None) -> list[Text]:
    """``deviation_lines`` of a thread whose lead changes: P(n) less the lead of the turn."""
    found = deviation_lines(console, deviation, 0.0, chosen)
    return [Text("Deviation of P(n) from the lead of its turn over n [um]"), *found[1:]] if found else []


def verdict_line(cause: str, sentence: str) -> Text:
    """``Verdict: Mechanical: ...``, its first word in the colour of the cause, where there are colours."""
    word, colon, rest = sentence.partition(":")
    return Text.assemble(("Verdict: ", "bold"), (word, _STYLES.get(cause, "bold")), colon, rest)


def _line(name: str, deviation: FloatArray, width: int, letters: Letters) -> Text:
    low, high = (f"{round(from_si(float(value), 'um'), 2) + 0.0:+.2f}"  # + 0.0: no negative zero
                 for value in (np.nanmin(deviation), np.nanmax(deviation)))
    room = width - len(name) - len(low) - len(high) - 6
    line = Text(f"{name}  ", no_wrap=True)
    if room >= SHORTEST:
        line.append(sparkline(deviation, room, letters), style="cyan").append("  ")
    return line.append(low, style="blue").append("..").append(high, style="magenta")


def _farthest(values: FloatArray, width: int) -> FloatArray:
    """(at most width,) of every stretch the value that is farthest from the median; NaN where none is there."""
    if values.size <= width:
        return values
    off = np.abs(values - np.nanmedian(values))
    bounds = np.linspace(0, values.size, width + 1).astype(np.int64)
    chosen = [int(low + np.argmax(np.nan_to_num(off[low:high], nan=-1.0)))
              for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)]
    return values[chosen]


def _range(known: FloatArray) -> tuple[float, float]:
    """Least and greatest of the values that are not far outside."""
    near = known[usual(known)]
    return float(near.min()), float(near.max())


def _letter(value: float, low: float, high: float, letters: Letters) -> str:
    if np.isnan(value):
        return letters.missing
    if value < low:
        return letters.below
    if value > high:
        return letters.above
    share = 0.5 if high - low < _FLAT else (value - low) / (high - low)
    return letters.levels[min(int(share * len(letters.levels)), len(letters.levels) - 1)]
