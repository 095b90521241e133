"""Runs as JSON documents: mm, um and degrees, with the unit in every key."""

from __future__ import annotations

import math
from typing import Any

from threadpitch.store.records import RunSummary, SeriesSummary, StoredPass, StoredRun, TurnStatistics
from threadpitch.units import from_si


def run_document(run: StoredRun) -> dict[str, Any]:
    """A run as JSON holds it: mm and degrees, null where a turn is missing."""
    return {
        **summary_document(run.summary),
        "passes": [_pass_document(one) for one in run.passes],
        "verdict": run.verdict,
        "provenance": run.provenance,
    }


def summary_document(run: RunSummary) -> dict[str, Any]:
    """A run as lists show it."""
    return {
        "run": run.number, "uid": run.uid, "recorded_at": run.recorded_at.isoformat(), "kind": run.kind,
        "source": run.source, "machine": run.machine, "program": run.program, "thread": run.thread,
        "serial_number": run.serial_number, "note": run.note, "cause": run.cause, "sentence": run.sentence,
        "trace_sha256": run.trace_sha256, "statistics": [series_document(one) for one in run.series],
    }


def series_document(one: SeriesSummary) -> dict[str, Any]:
    """The statistics of one pass at one start angle."""
    return {
        "calculator": one.calculator, "pass": one.label, "start_angle_deg": degrees(one.start_angle),
        "target_mm": length(one.target, "mm"), **_statistics_document(one),
        "effective": None if one.effective is None else _statistics_document(one.effective),
    }


def _statistics_document(one: TurnStatistics) -> dict[str, Any]:
    return {
        "turns": one.turns, "min_mm": length(one.minimum, "mm"), "max_mm": length(one.maximum, "mm"),
        "mean_mm": length(one.mean, "mm"), "standard_deviation_um": length(one.standard_deviation, "um"),
    }


def degrees(angle: float) -> float:
    """A start angle without the rounding error of the conversion."""
    return round(from_si(angle, "deg"), 9)


def _pass_document(one: StoredPass) -> dict[str, Any]:
    table = one.table
    return {
        "calculator": one.calculator, "pass": one.label, "target_mm": length(one.target, "mm"),
        "start_angles_deg": [degrees(angle) for angle in table.start_angles.tolist()],
        "pitch_mm": [[length(value, "mm") for value in row] for row in table.pitch.tolist()],
        "uncertainty_um": None if table.uncertainty is None else [
            [length(value, "um") for value in row] for row in table.uncertainty.tolist()],
        "in_metal": None if one.in_metal is None else one.in_metal.tolist(),
        "extrapolated": table.extrapolated.tolist(), "turns_before": table.turns_before, "notes": list(table.notes),
        "told_si": dict(one.told),
    }


def length(value: float | None, unit: str) -> float | None:
    """A length in a unit; None where it is not known."""
    return None if value is None or math.isnan(value) else from_si(value, unit)
