"""A run -> rows of the database. All of these are called within one writing transaction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, Table, insert, select

from threadpitch.store import schema
from threadpitch.store.errors import StoreError
from threadpitch.store.records import NewRun, StoredPass
from threadpitch.store.texts import json_text, storable, utc_text
from threadpitch.store.trace_folder import WrittenTrace

KINDS = ("simulation", "log", "study")


def check(run: NewRun) -> None:
    """Refuse a run before anything is written.

    Raises:
        StoreError: what kind it is, or a pass whose arrays do not fit together.
    """
    if run.kind not in KINDS:
        raise StoreError(f"a run of kind {run.kind!r} is not known; choose {', '.join(KINDS)}")
    for one in run.passes:
        shape = one.table.pitch.shape
        for name, values in (("in_metal", one.in_metal), ("uncertainty", one.table.uncertainty)):
            if values is not None and values.shape != shape:
                raise StoreError(f"pass {one.label!r}: {name} is {values.shape}, the pitches are {shape}; give one "
                                 "value for each")


def add_run(connection: Connection, run: NewRun, trace: WrittenTrace | None) -> int:
    """The number of the run, which is new, or was added under this uid before."""
    there = connection.execute(select(schema.runs.c.number).where(schema.runs.c.uid == run.uid)).scalar_one_or_none()
    if there is not None:
        return int(there)
    if trace is not None and not connection.execute(
            select(schema.traces.c.sha256).where(schema.traces.c.sha256 == trace.sha256)).first():
        connection.execute(insert(schema.traces), {"sha256": trace.sha256, "bytes": trace.size})
    verdict = run.verdict or {}
    number = _insert(connection, schema.runs, {
        "uid": run.uid, "recorded_at": utc_text(datetime.now(UTC)), "kind": run.kind,
        **{name: storable(getattr(run, name)) for name in ("source", "machine", "program", "thread", "serial_number",
                                                           "note")},
        "cause": verdict.get("cause"), "sentence": verdict.get("sentence"),
        "verdict": None if run.verdict is None else json_text(run.verdict), "provenance": json_text(run.provenance),
        "trace_sha256": None if trace is None else trace.sha256,
    })
    for place, one in enumerate(run.passes):
        _add_pass(connection, number, place, one)
    return number


def _add_pass(connection: Connection, run: int, place: int, one: StoredPass) -> None:
    table, thread = one.table, one.turns_of_thread
    identity = _insert(connection, schema.passes, {
        "run": run, "place": place, "calculator": storable(one.calculator), "label": storable(one.label),
        "target": one.target, "revolutions": table.pitch.shape[1], "turns_before": table.turns_before,
        "told": json_text(one.told), "notes": json_text(list(table.notes)),
    })
    for row, angle in enumerate(table.start_angles.tolist()):
        number = _insert(connection, schema.series, {
            "pass": identity, "place": row, "start_angle": angle, "extrapolated": bool(table.extrapolated[row]),
            **_statistics(table.pitch[row]),
            **({} if thread is None else _statistics(table.pitch[row][thread[row]], "effective_")),
        })
        turns = list(_turns(number, one, row))
        if turns:
            connection.execute(insert(schema.pitches), turns)


def _statistics(pitch: NDArray[np.float64], prefix: str = "") -> dict[str, Any]:
    """Over the turns that are there, (revolutions,) m."""
    known = pitch[~np.isnan(pitch)]
    figures = {
        "turns": known.size,
        "minimum": float(known.min()) if known.size else None,
        "maximum": float(known.max()) if known.size else None,
        "mean": float(known.mean()) if known.size else None,
        "standard_deviation": float(np.std(known, ddof=1)) if known.size > 1 else None,
    }
    return {f"{prefix}{name}": value for name, value in figures.items()}


def _turns(series: int, one: StoredPass, row: int) -> Iterator[dict[str, Any]]:
    pitches = one.table.pitch[row].tolist()
    uncertain = [None] * len(pitches) if one.table.uncertainty is None else one.table.uncertainty[row].tolist()
    metal = [None] * len(pitches) if one.in_metal is None else one.in_metal[row].tolist()
    for n, (pitch, uncertainty, in_metal) in enumerate(zip(pitches, uncertain, metal, strict=True), start=1):
        if not math.isnan(pitch):
            known = None if uncertainty is None or math.isnan(uncertainty) else uncertainty
            yield {"series": series, "n": n, "pitch": pitch, "uncertainty": known, "in_metal": in_metal}


def _insert(connection: Connection, table: Table, row: Mapping[str, Any]) -> int:
    """The number that the database gives the row."""
    key = connection.execute(insert(table), row).inserted_primary_key
    assert key is not None  # of one row
    return int(key[0])
