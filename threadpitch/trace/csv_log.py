"""Reader for CSV logs, plain or compressed by gzip: rows -> one ``Trace`` per group.

The standard library's ``csv`` splits the rows, block by block: it is the only reader at hand that keeps the number of
every line for the messages (numpy's readers name neither file nor line, and take no text column beside numbers
without a second pass), and the large readers (pandas, polars, arrow) would be the heaviest dependency of all.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from threadpitch import units
from threadpitch.trace.recording import IntArray, Trace, TraceError
from threadpitch.trace.soundness import TURN, FloatArray
from threadpitch.trace.text_rows import Block, brief, rows_of

_TIME_NAME = re.compile(r"(?:time|t|timestamp)[\s_]*[\[(]?(s|ms|us|µs|μs|min|)[\])]?", re.IGNORECASE)
_NO_GROUP = {"", "0", "false", "nan"}  # of a group's value: not threading


@dataclass(frozen=True)
class ColumnChoice:
    """Which columns of a log are which, and their units; names as in the header.

    ``angle_unit``: rev, deg, rad, or count, which needs ``counts_per_turn``. Without ``group`` all rows are one group,
    called 1. Without ``time`` a column that is called time or t, with or without its unit, is taken.

    Raises:
        TraceError: a unit is not known or does not fit; ``counts_per_turn`` is missing or not positive.
    """

    angle: str
    position: str
    angle_unit: str = "rev"
    position_unit: str = "mm"
    group: str | None = None
    time: str | None = None
    counts_per_turn: float | None = None

    def __post_init__(self) -> None:
        self.angle_factor()
        self.position_factor()

    def angle_factor(self) -> float:
        """``rad = factor * value``."""
        if self.angle_unit != "count":
            return _factor(self.angle_unit, "rad", "angle; known are rev, deg, rad and count")
        if self.counts_per_turn is None:
            raise TraceError("the angle unit count needs the counts per turn (lines of the encoder times 4)")
        if not 0.0 < self.counts_per_turn < float("inf"):
            raise TraceError(f"counts per turn is {self.counts_per_turn}; give a positive number")
        return TURN / self.counts_per_turn

    def position_factor(self) -> float:
        """``m = factor * value``."""
        return _factor(self.position_unit, "m", "position; known are mm, m, um and inch")


def read_groups(path: str | Path, choice: ColumnChoice) -> list[Trace]:
    """The groups of a CSV or .csv.gz log, in the order of the file; ``Trace.name`` is the group's value.

    Rows whose group value is 0, empty or false are not threading and are left out. A group is a stretch of such rows
    with one value; where a value comes again after other rows, a new group begins (a flag that is true in every pass),
    called ``true (2)``. Angle and time may restart with every group. An angle that counts down in a group is turned
    around, which ``Trace.notes`` says; start angles then count in the turning direction too.

    Raises:
        TraceError: with file and line: whatever keeps the file from being read, a column that is not there, text or
            NaN in a number, rows of unequal length, no threading row, and all that ``Trace`` refuses.
    """
    source = str(path)
    stretches: list[_Stretch] = []
    columns: _Columns | None = None
    threading = _Threading()
    for block in rows_of(Path(path)):
        columns = columns or _find_columns(block, choice)
        columns = _add_rows(block, columns, threading, stretches)
    if columns is None:
        raise TraceError(f"{source}: there are no rows below the header")
    if not stretches:
        raise TraceError(f"{source}: no row is threading: column {brief(str(choice.group))} is 0, empty or false "
                         "everywhere; choose another group column or none")
    seen: dict[str, int] = {}
    return [_trace(stretch, source, choice, seen) for stretch in stretches]


@dataclass(frozen=True)
class _Columns:
    """Index of each column in a row."""

    angle: int
    position: int
    group: int | None
    time: int | None
    time_factor: float
    time_is_guessed: bool


@dataclass
class _Stretch:
    """Neighbouring rows of one group, block by block; ``open`` while the next row may belong to it."""

    label: str
    open: bool = True
    lines: list[IntArray] = field(default_factory=list)
    angle: list[FloatArray] = field(default_factory=list)
    position: list[FloatArray] = field(default_factory=list)
    time: list[FloatArray] = field(default_factory=list)


class _Threading(dict[str, str]):
    """Text of the group column -> label, "" for rows that are not threading; each text is read once."""

    def __missing__(self, text: str) -> str:
        label = text.strip()
        try:
            number = float(label)
            if number == 0.0:
                label = ""
            elif number.is_integer() and abs(number) < 1e15:
                label = str(int(number))  # 1, 1.0 and 1e0 are one group
        except ValueError:
            pass
        self[text] = "" if label.casefold() in _NO_GROUP else label
        return self[text]


def _factor(name: str, target: str, wanted: str) -> float:
    try:
        return units.conversion(name, target)[0]
    except units.UnitError:
        raise TraceError(f"{brief(name)} is not a unit of the {wanted}") from None


def _find_columns(block: Block, choice: ColumnChoice) -> _Columns:
    header = [name.strip() for name in block.header]
    guessed = next(((i, found) for i, name in enumerate(header) if (found := _TIME_NAME.fullmatch(name))), None)
    named = _index(block, header, choice.time) if choice.time is not None else None
    unit_match = _TIME_NAME.fullmatch(choice.time) if choice.time is not None else (guessed[1] if guessed else None)
    return _Columns(
        angle=_index(block, header, choice.angle),
        position=_index(block, header, choice.position),
        group=None if choice.group is None else _index(block, header, choice.group),
        time=named if named is not None else (guessed[0] if guessed else None),
        time_factor=units.to_si(1.0, (unit_match[1] if unit_match else "") or "s"),
        time_is_guessed=named is None,
    )


def _index(block: Block, header: list[str], name: str) -> int:
    found = [i for i, other in enumerate(header) if other == name.strip()]
    if len(found) == 1:
        return found[0]
    if found:
        raise TraceError(f"{block.source}:{block.header_line}: column {brief(name)} is there {len(found)} times; "
                         "give every column a name of its own")
    near = difflib.get_close_matches(name, header, n=3, cutoff=0.4) or header[:12]
    raise TraceError(f"{block.source}:{block.header_line}: there is no column {brief(name)}; "
                     f"nearest are {', '.join(brief(other) for other in near)}")


def _add_rows(block: Block, columns: _Columns, threading: _Threading, stretches: list[_Stretch]) -> _Columns:
    """Adds the threading rows of the block to the stretches."""
    group = columns.group
    labels = ["1"] * len(block.rows) if group is None else [threading[row[group]] for row in block.rows]
    first = 0
    for label, run in groupby(labels):
        last = first + sum(1 for _ in run)
        if stretches and stretches[-1].label != label:
            stretches[-1].open = False
        if label:
            if not stretches or not stretches[-1].open:
                stretches.append(_Stretch(label))
            columns = _drop_guessed_text(columns, block.rows[first])
            _add_stretch(stretches[-1], block.part(first, last), columns)
        first = last
    return columns


def _drop_guessed_text(columns: _Columns, row: list[str]) -> _Columns:
    """A column that is only called time, but holds a date, is not a time in seconds."""
    if columns.time_is_guessed and columns.time is not None:
        try:
            float(row[columns.time])
        except ValueError:
            return replace(columns, time=None)
    return replace(columns, time_is_guessed=False)


def _add_stretch(stretch: _Stretch, block: Block, columns: _Columns) -> None:
    stretch.lines.append(np.array(block.lines, dtype=np.int64))
    stretch.angle.append(_numbers(block, columns.angle))
    stretch.position.append(_numbers(block, columns.position))
    if columns.time is not None:
        with np.errstate(over="ignore"):  # the trace refuses what becomes infinite
            stretch.time.append(_numbers(block, columns.time) * columns.time_factor)


def _numbers(block: Block, column: int) -> FloatArray:
    try:
        return np.fromiter((float(row[column]) for row in block.rows), np.float64, len(block.rows))
    except ValueError:
        line, text = next((line, row[column]) for line, row in zip(block.lines, block.rows, strict=True)
                          if not _is_number(row[column]))
    name = block.header[column].strip()
    if not text.strip():
        raise TraceError(f"{block.source}:{line}: column {brief(name)} is empty; mend or leave out this row")
    mend = "write the decimal sign as a point" if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text) else "mend this row"
    raise TraceError(f"{block.source}:{line}: column {brief(name)} holds {brief(text)}, not a number; {mend}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _trace(stretch: _Stretch, source: str, choice: ColumnChoice, seen: dict[str, int]) -> Trace:
    seen[stretch.label] = seen.get(stretch.label, 0) + 1
    times = seen[stretch.label]
    with np.errstate(over="ignore"):  # the trace refuses what becomes infinite
        angle = np.concatenate(stretch.angle) * choice.angle_factor()
    notes: tuple[str, ...] = ()
    if _counts_down(angle):
        angle = -angle
        notes = ("the angle counts down: turned around, so that it counts up in the turning direction",)
    trace = Trace(
        angle=angle,
        position=np.concatenate(stretch.position) * choice.position_factor(),
        time=np.concatenate(stretch.time) if stretch.time else None,
        name=stretch.label if times == 1 else f"{stretch.label} ({times})",
        source=source,
        lines=np.concatenate(stretch.lines),
        resolution=choice.angle_factor() if choice.angle_unit == "count" else 0.0,
        notes=notes,
    )
    turns = (trace.angle[-1] - trace.angle[0]) / TURN
    if turns > trace.angle.size:
        raise TraceError(f"{trace.whole()}: {turns:.0f} turns in {trace.angle.size} samples; "
                         f"is the unit of the angle really {choice.angle_unit}?")
    return trace


def _counts_down(angle: FloatArray) -> bool:
    """More samples fall than rise, and so does the whole."""
    steps = np.diff(angle)
    return bool(angle[-1] < angle[0] and np.count_nonzero(steps < 0.0) > np.count_nonzero(steps > 0.0))
