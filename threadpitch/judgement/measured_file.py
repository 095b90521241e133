"""Reader for measured pitches: a CSV table -> measured threads, one for each flank and start angle.

    turn,pitch_mm,uncertainty_um,flank,start_angle_deg
    1,1.5003,0.5,left,0

``turn`` (or n) numbers the turns as the nominal table does, ``position`` (or z) is the middle between the two grooves
along the axis. Units stand in the header (``pitch_um``, ``pitch [um]``); without one they are mm and degrees. Only the
pitch has to be there; an empty one is a turn that was not measured.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from threadpitch import units
from threadpitch.judgement.alignment import MeasuredThread
from threadpitch.judgement.verdict import JudgementError
from threadpitch.trace import FloatArray
from threadpitch.trace.choice import brief
from threadpitch.trace.text_rows import rows_of

_NAMES = {"turn": "turn", "n": "turn", "revolution": "turn", "position": "position", "z": "position",
          "pitch": "pitch", "lead": "pitch", "flank": "flank", "start_angle": "start_angle",
          "uncertainty": "uncertainty", "u": "uncertainty"}
_DEFAULT_UNITS = {"position": "mm", "pitch": "mm", "uncertainty": "mm", "start_angle": "deg"}
_SI = {"position": "m", "pitch": "m", "uncertainty": "m", "start_angle": "rad"}
_UNIT = re.compile(r"(?P<name>.+?)"
                   r"(?:_(?P<suffix>mm|um|µm|μm|nm|m|inch|deg|rad|rev)|\s*[\[(](?P<bracket>[^\])]*)[\])])?")
_MISSING = {"", "nan", "-"}


@dataclass(frozen=True)
class _Column:
    index: int
    name: str  # as in the header
    factor: float


def read_measured(path: str | Path) -> list[MeasuredThread]:
    """The measured threads of a CSV file, plain or .gz, in the order of the file.

    Raises:
        TraceError: the file cannot be read, or its rows differ in length.
        JudgementError: there is no column of pitches, a unit does not fit, or a field is not a number.
    """
    columns: dict[str, _Column] = {}
    rows: dict[tuple[str, float | None], list[dict[str, float]]] = {}
    for head, block in rows_of(Path(path)):
        columns = columns or _columns(head.names, f"{path}:{head.line}")
        for line, row in zip(block.lines, block.rows, strict=True):
            values = dict(_numbers(row, columns, f"{path}:{line}"))
            start = values.pop("start_angle", None)
            flank = row[columns["flank"].index].strip() if "flank" in columns else ""
            rows.setdefault((flank, start), []).append(values)
    if not rows:
        raise JudgementError(f"{path}: there are no rows below the header")
    return [_thread(found, flank, start, str(path)) for (flank, start), found in rows.items()]


def _columns(header: list[str], place: str) -> dict[str, _Column]:
    found: dict[str, _Column] = {}
    for index, title in enumerate(header):
        match = _UNIT.fullmatch(title.strip())
        meaning = _NAMES.get(match["name"].strip().lower().replace(" ", "_")) if match else None
        if match is None or meaning is None:
            continue
        if meaning in found:
            raise JudgementError(f"{place}: columns {brief(found[meaning].name)} and {brief(title)} both give the "
                                 f"{meaning}; leave one of them out")
        found[meaning] = _Column(index, title.strip(), _factor(meaning, match["suffix"] or match["bracket"], place))
    if "pitch" not in found:
        names = ", ".join(brief(title) for title in header[:8])
        raise JudgementError(f"{place}: there is no column of pitches among {names}; call it pitch_mm")
    return found


def _factor(meaning: str, unit: str | None, place: str) -> float:
    if meaning not in _SI:
        return 1.0
    try:
        return units.conversion(unit or _DEFAULT_UNITS[meaning], _SI[meaning])[0]
    except units.UnitError:
        raise JudgementError(f"{place}: {brief(unit or '')} is no unit of the {meaning}; write it like "
                             f"{meaning}_{_DEFAULT_UNITS[meaning]}") from None


def _numbers(row: list[str], columns: dict[str, _Column], place: str) -> Iterator[tuple[str, float]]:
    for meaning, column in columns.items():
        if meaning == "flank":
            continue
        text = row[column.index].strip()
        if text.lower() in _MISSING:
            if meaning != "pitch":
                raise JudgementError(f"{place}: column {brief(column.name)} is empty; only pitches may be missing")
            yield meaning, math.nan
            continue
        try:
            value = float(text if "_" not in text else "")  # Python reads 1_0 as 10
        except ValueError:
            mend = "write the decimal sign as a point" if re.fullmatch(r"[-+]?\d+,\d+", text) else "mend this row"
            raise JudgementError(f"{place}: column {brief(column.name)} holds {brief(text)}, not a number; {mend}") \
                from None
        if not math.isfinite(value):
            raise JudgementError(f"{place}: column {brief(column.name)} holds {brief(text)}; mend this row")
        yield meaning, value * column.factor


def _thread(rows: list[dict[str, float]], flank: str, start_angle: float | None, source: str) -> MeasuredThread:
    def column(name: str) -> FloatArray | None:
        return np.array([row[name] for row in rows]) if name in rows[0] else None

    pitch = column("pitch")
    assert pitch is not None  # without it the columns are refused
    return MeasuredThread(pitch, column("turn"), column("position"), column("uncertainty"), start_angle, flank, source)
