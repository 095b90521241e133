"""A run out of the store -> the threads of a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from threadpitch.judgement import read_verdict
from threadpitch.pitch import thread_proper
from threadpitch.report.columns import read_columns
from threadpitch.report.content import Measured, PassOverview, ReportError, Samples, Thread
from threadpitch.report.pitch_file import CalculatedPass
from threadpitch.report.recorded_log import trace_samples
from threadpitch.report.recorded_run import RecordedRun, pass_overview, run_provenance
from threadpitch.report.run_recording import Recording
from threadpitch.store import StoredPass, StoredRun
from threadpitch.trace import Trace, TraceError

_MEASURED = "measured"  # calculator of a pass that was measured
_TEXTS = ("machine", "program", "thread", "serial_number", "note", "source")


def stored_threads(run: StoredRun) -> list[Thread]:
    """Of a simulation the passes that make the final flank, of a log its last group.

    Raises:
        ReportError: the run has no pass.
    """
    if not run.passes:
        raise ReportError(f"run {run.summary.number} has no pitches; nothing can be shown of it")
    threads = _of_simulation(run) if run.summary.kind == "simulation" else [_of_log(run)]
    about = tuple((name.replace("_", " "), str(getattr(run.summary, name))) for name in _TEXTS
                  if getattr(run.summary, name))
    when = ("recorded", run.summary.recorded_at.strftime("%Y-%m-%d %H:%M:%S UTC"))
    return [replace(one, provenance=(when, *about, *one.provenance)) for one in threads]


def run_name(run: StoredRun) -> str:
    """What people call it: number, serial number, thread."""
    words = (run.summary.serial_number, run.summary.thread, run.summary.machine)
    return ", ".join([f"run {run.summary.number}", *(word for word in words if word)])


def _of_simulation(run: StoredRun) -> list[Thread]:
    passes = [_calculated(one, number) for number, one in enumerate(run.passes, start=1)]
    told = {(one.calculator, made.number): one.told for one, made in zip(run.passes, passes, strict=True)}
    nominal = [one for one in passes if one.calculator == passes[0].calculator]
    wanted = [one for one in nominal if told[one.calculator, one.number].get("final_flank")] or nominal[-1:]
    names = dict.fromkeys(one.calculator for one in passes)
    recordings = {name: Recording(run.trace, run.provenance, [one for one in passes if one.calculator == name])
                  for name in names} if run.trace is not None else {}
    found = []
    for one in wanted:
        described = Thread(f"{run_name(run)}, pass {one.number}", one.table, one.target, one.chosen,
                           others=pass_overview(nominal), provenance=tuple(run_provenance(run.provenance)))
        if recordings:
            thread = RecordedRun(run.provenance, passes, recordings).thread(described, one)
        else:
            thread = replace(described, notes=("No recording: the store holds no trace of this run",))
        found.append(thread if run.verdict is None else replace(thread, verdict=read_verdict(dict(run.verdict))))
    return found


def _calculated(one: StoredPass, number: int) -> CalculatedPass:
    target = one.target if one.target is not None else float(np.nanmedian(one.table.pitch))
    in_metal = np.ones(one.table.pitch.shape, dtype=np.bool_) if one.in_metal is None else one.in_metal
    return CalculatedPass(one.calculator, int(one.told.get("number") or number),
                          int(one.told.get("start_number") or 1), one.table, target, in_metal)


def _of_log(run: StoredRun) -> Thread:
    groups = [one for one in run.passes if one.calculator != _MEASURED]
    last = groups[-1] if groups else run.passes[-1]
    chosen = thread_proper(last.table.pitch)
    target = last.target if last.target is not None else float(np.median(last.table.pitch[chosen]))
    samples, notes = _log_samples(run, last)
    measured = tuple(Measured(", ".join(word for word in (_MEASURED, one.label) if word),
                              np.asarray(np.flatnonzero(~np.isnan(row)) + 1.0, dtype=np.float64), row[~np.isnan(row)])
                     for one in run.passes if one.calculator == _MEASURED for row in one.table.pitch)
    return Thread(f"{run_name(run)}, group {last.label}", last.table, target, chosen, measured=measured,
                  verdict=None if run.verdict is None else read_verdict(dict(run.verdict)), samples=samples,
                  others=_groups(groups), notes=(*last.table.notes, *notes),
                  provenance=tuple(run_provenance(run.provenance)))


def _groups(groups: Sequence[StoredPass]) -> PassOverview:
    rows = []
    for one in groups:
        pitch = one.table.pitch[thread_proper(one.table.pitch)]
        rows.append((f"group {one.label}", float(pitch.min()), float(pitch.max()), float(pitch.mean())))
    return PassOverview(tuple(rows))


def _log_samples(run: StoredRun, group: StoredPass) -> tuple[Samples | None, tuple[str, ...]]:
    if run.trace is None:
        return None, ("No recording: the store holds no trace of this run",)
    try:
        found = read_columns(run.trace, ("time", "angle", "position"), group=("group", group.label))
        trace = Trace(found["angle"], found["position"], found.get("time"))
    except (ReportError, TraceError, OSError, KeyError) as error:
        return None, (f"No recording: {error}",)
    return trace_samples(trace, group.table), ()
