"""Rows of the database -> runs. All of these are called within one transaction, so that what they find agrees."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from sqlalchemy import ColumnElement, Connection, RowMapping, func, or_, select

from threadpitch.pitch import PitchTable
from threadpitch.store import schema
from threadpitch.store.errors import StoreError
from threadpitch.store.records import RunFilter, RunSummary, SeriesSummary, StoredPass, TurnStatistics
from threadpitch.store.texts import instant, storable, utc_text

TEXTS = ("source", "machine", "program", "thread", "serial_number", "note", "cause")
CHOICES = ("machine", "program", "thread", "cause")
GREATEST = 2**63 - 1  # number that a database can be asked for
_MANY = 500  # numbers in one question: databases bound their number


def count_runs(connection: Connection, wanted: RunFilter) -> int:
    """How many runs there are of this kind, whatever the limit."""
    return connection.execute(select(func.count()).select_from(schema.runs).where(*_conditions(wanted))).scalar_one()


def find_runs(connection: Connection, wanted: RunFilter) -> list[RunSummary]:
    """The runs, newest first."""
    asked = (select(schema.runs).where(*_conditions(wanted)).order_by(schema.runs.c.number.desc())
             .limit(wanted.limit).offset(wanted.offset))
    return _summaries(connection, list(connection.execute(asked).mappings()))


def find_run(connection: Connection, number: int) -> tuple[RunSummary, RowMapping]:
    """A run, with its row.

    Raises:
        StoreError: there is none of this number.
    """
    row = None if number > GREATEST else connection.execute(
        select(schema.runs).where(schema.runs.c.number == number)).mappings().first()
    if row is None:
        raise StoreError(no_run(number))
    return _summaries(connection, [row])[0], row


def run_of_uid(connection: Connection, uid: str) -> RunSummary | None:
    """The run of this uid; None where there is none."""
    row = connection.execute(select(schema.runs).where(schema.runs.c.uid == storable(uid))).mappings().first()
    return None if row is None else _summaries(connection, [row])[0]


def no_run(number: int) -> str:
    """What to say where there is no run of this number."""
    return f"run {number} is not in the store; `threadpitch store list` shows those that are"


def choices(connection: Connection) -> dict[str, list[str]]:
    """The machines, programs, threads and causes that there are."""
    found = {}
    for name in CHOICES:
        column = schema.runs.c[name]
        asked = select(column).where(column.is_not(None), column != "").distinct().order_by(column)
        found[name] = list(connection.execute(asked).scalars())
    return found


def passes_of(connection: Connection, number: int) -> tuple[StoredPass, ...]:
    """The passes of a run with P(n) of every start angle."""
    asked = select(schema.passes).where(schema.passes.c.run == number).order_by(schema.passes.c.place)
    passes = list(connection.execute(asked).mappings())
    series = _by_pass(connection, [one["id"] for one in passes])
    turns: dict[int, list[RowMapping]] = defaultdict(list)
    asked_turns = (select(schema.pitches)
                   .select_from(schema.pitches.join(schema.series).join(schema.passes))
                   .where(schema.passes.c.run == number))
    for turn in connection.execute(asked_turns).mappings():
        turns[turn["series"]].append(turn)
    return tuple(_pass(one, series[one["id"]], turns) for one in passes)


def _conditions(wanted: RunFilter) -> list[ColumnElement[bool]]:
    columns = schema.runs.c
    found: list[ColumnElement[bool]] = []
    for name in ("machine", "program", "thread", "serial_number", "cause", "kind"):
        value = getattr(wanted, name)
        if value is not None:
            found.append(columns[name] == storable(value))
    if wanted.since is not None:
        found.append(columns.recorded_at >= utc_text(wanted.since))
    if wanted.until is not None:
        found.append(columns.recorded_at <= utc_text(wanted.until))
    if wanted.text:
        text = storable(wanted.text)
        found.append(or_(*(columns[name].icontains(text, autoescape=True) for name in TEXTS)))
    return found


def _summaries(connection: Connection, rows: Sequence[RowMapping]) -> list[RunSummary]:
    passes: dict[int, list[RowMapping]] = defaultdict(list)
    series: dict[int, list[RowMapping]] = {}
    for numbers in _parts([row["number"] for row in rows]):
        asked = select(schema.passes).where(schema.passes.c.run.in_(numbers)).order_by(schema.passes.c.place)
        found = list(connection.execute(asked).mappings())
        for one in found:
            passes[one["run"]].append(one)
        series |= _by_pass(connection, [one["id"] for one in found])
    return [_summary(row, [_series_summary(one, line) for one in passes[row["number"]] for line in series[one["id"]]])
            for row in rows]


def _by_pass(connection: Connection, passes: Sequence[int]) -> dict[int, list[RowMapping]]:
    """The series of passes, in their order."""
    found: dict[int, list[RowMapping]] = {one: [] for one in passes}
    for part in _parts(passes):
        asked = select(schema.series).where(schema.series.c["pass"].in_(part)).order_by(schema.series.c.place)
        for row in connection.execute(asked).mappings():
            found[row["pass"]].append(row)
    return found


def _parts(numbers: Sequence[int]) -> Iterable[Sequence[int]]:
    return (numbers[first:first + _MANY] for first in range(0, len(numbers), _MANY))


def _summary(row: RowMapping, series: Sequence[SeriesSummary]) -> RunSummary:
    plain = ("number", "uid", "kind", "source", "machine", "program", "thread", "serial_number", "note", "cause",
             "sentence", "trace_sha256")
    return RunSummary(recorded_at=instant(row["recorded_at"]), series=tuple(series),
                      **{name: row[name] for name in plain})


def _series_summary(one: RowMapping, row: RowMapping) -> SeriesSummary:
    effective = None if row["effective_turns"] is None else TurnStatistics(**_statistics(row, "effective_"))
    return SeriesSummary(calculator=one["calculator"], label=one["label"], start_angle=row["start_angle"],
                         target=one["target"], effective=effective, **_statistics(row))


def _statistics(row: RowMapping, prefix: str = "") -> dict[str, Any]:
    figures = ("minimum", "maximum", "mean", "standard_deviation")
    return {"turns": row[f"{prefix}turns"], **{name: _number(row[f"{prefix}{name}"]) for name in figures}}


def _pass(one: RowMapping, series: Sequence[RowMapping], turns: Mapping[int, Sequence[RowMapping]]) -> StoredPass:
    shape = len(series), one["revolutions"]
    pitch, uncertainty = np.full(shape, np.nan), np.full(shape, np.nan)
    in_metal = np.zeros(shape, dtype=np.bool_)
    told_of_metal = False
    for row, line in enumerate(series):
        for turn in turns.get(line["id"], ()):
            place = row, turn["n"] - 1
            pitch[place], uncertainty[place] = turn["pitch"], _number(turn["uncertainty"])
            in_metal[place] = bool(turn["in_metal"])
            told_of_metal |= turn["in_metal"] is not None
    table = PitchTable(
        start_angles=np.array([line["start_angle"] for line in series], dtype=np.float64),
        pitch=pitch,
        crossings=np.full((shape[0], shape[1] + 1), np.nan),
        extrapolated=np.array([line["extrapolated"] for line in series], dtype=np.bool_),
        turns_before=one["turns_before"],
        notes=tuple(json.loads(one["notes"])),
        uncertainty=None if np.isnan(uncertainty).all() else uncertainty,
    )
    return StoredPass(one["calculator"], one["label"], table, one["target"], in_metal if told_of_metal else None,
                      dict(json.loads(one["told"])))


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
