"""Simulations and analysed logs -> the runs that the store keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.cosim.metadata import versions
from threadpitch.judgement import MeasuredThread, Verdict, verdict_document
from threadpitch.lathe import Simulation
from threadpitch.passes import Pass
from threadpitch.pitch import GroupPitch, PitchTable, StreamedPitch
from threadpitch.runs.events import RunEvents
from threadpitch.store import NewRun, StoredPass
from threadpitch.store.records import LOG, MEASURED


def simulation_run(simulation: Simulation, events: RunEvents, *, verdict: Verdict | None = None,
                   measured: Sequence[MeasuredThread] = (), trace: Path | None = None) -> NewRun:
    """The run of a simulation: the passes as every calculator saw them, and the thread as it was measured."""
    passes = [stored_pass(calculator, one) for calculator in simulation.calculators
              for one in simulation.passes_of(calculator)]
    passes += _measured_passes(measured, None)
    return NewRun(kind=events.kind, source=events.source, uid=events.uid, passes=tuple(passes), trace=trace,
                  verdict=None if verdict is None else verdict_document(verdict),
                  provenance=simulation.result.metadata | {"warnings": list(simulation.result.warnings)},
                  **vars(events.labels))


def stored_pass(calculator: str, one: Pass) -> StoredPass:
    """A pass as a calculator saw it, with what the control says of it."""
    lengths = {"depth": one.depth, "lead": one.lead, "pitch": one.pitch, "start_angle": one.start_angle}
    in_metal = None if one.effective is None else one.in_metal
    return StoredPass(calculator, str(one.number), one.table, one.target, in_metal,
                      {"number": one.number, "start_number": one.start_number, "kind": one.kind, **lengths,
                       "final_flank": one.final_flank})


def log_run(groups: Sequence[GroupPitch | StreamedPitch], events: RunEvents, *, target: float | None = None,
            measured: Sequence[MeasuredThread] = (), verdict: Verdict | None = None,
            options: Mapping[str, Any] | None = None, trace: Path | None = None) -> NewRun:
    """The run of an analysed log: a pass for every group, and for every measured thread.

    ``target``: movement per revolution that was wanted, m. ``options``: how the log was read.
    """
    passes = [StoredPass(LOG, group.label, group.table, target) for group in groups]
    passes += _measured_passes(measured, target)
    return NewRun(kind=events.kind, source=events.source, uid=events.uid, passes=tuple(passes), trace=trace,
                  verdict=None if verdict is None else verdict_document(verdict),
                  provenance=versions() | {"options": dict(options or {})}, **vars(events.labels))


def _measured_passes(measured: Sequence[MeasuredThread], target: float | None) -> list[StoredPass]:
    return [StoredPass(MEASURED, one.flank or "", _measured_table(one), target) for one in measured]


def _measured_table(one: MeasuredThread) -> PitchTable:
    """Every pitch at its turn, where turns are numbered; NaN between."""
    numbers = np.arange(one.pitch.size)
    if one.turn is not None and np.all(one.turn >= 1.0) and np.all(one.turn == np.rint(one.turn)):
        numbers = one.turn.astype(np.int64) - 1
    shape = 1, int(numbers.max()) + 1
    pitch, uncertainty = np.full(shape, np.nan), np.full(shape, np.nan)
    pitch[0, numbers] = one.pitch
    if one.uncertainty is not None:
        uncertainty[0, numbers] = one.uncertainty
    table = PitchTable.of_pitches(pitch, [0.0 if one.start_angle is None else one.start_angle])
    notes = () if one.start_angle is not None else ("the start angle of the measured pitches is not known",)
    return replace(table, notes=notes, uncertainty=None if one.uncertainty is None else uncertainty)
