"""The folder of a run -> the threads of a report."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.diagnosis import UNCERTAINTY
from threadpitch.judgement import MeasuredThread, read_verdict
from threadpitch.pitch import statistics
from threadpitch.report.content import PassOverview, ReportError, Thread, judged, laid_over
from threadpitch.report.pitch_file import CalculatedPass, read_pitches
from threadpitch.report.run_recording import Recording
from threadpitch.run_folder import METADATA
from threadpitch.trace import FloatArray
from threadpitch.units import from_si

_SCREW = "z_drive.screw_lead"


@dataclass(frozen=True, eq=False)
class _Folder:
    path: Path
    passes: list[CalculatedPass]
    result: Mapping[str, Any]  # result.json
    metadata: Mapping[str, Any]

    @functools.cached_property
    def told(self) -> dict[int, Mapping[str, Any]]:
        """What the run says of its passes, by their numbers."""
        passes = self.result.get("passes")
        return {one["pass"]: one for one in passes if isinstance(one, dict) and isinstance(one.get("pass"), int)} \
            if isinstance(passes, list) else {}

    def judged(self, thread: Thread, number: int) -> Thread:
        """With the verdict that the run printed, and what it said of the control; where it judged this pass."""
        verdict = self.result.get("verdict")
        if not isinstance(verdict, dict) or verdict.get("pass") != number:
            return thread
        try:
            control = verdict["control"]
            lines = control.get("lines")  # runs of former versions told the first start angle only
            told = [] if not control.get("shows") else [line.strip() for line in lines] if lines else \
                [f"Where in the control: {sentence}" for sentence in control["sentences"]]
            return replace(thread, verdict=read_verdict(verdict), notes=(*thread.notes, *told))
        except (KeyError, TypeError, AttributeError, IndexError) as error:
            raise ReportError(f"{self.path / 'result.json'}: the verdict is damaged ({error}); run again") from None

    def recordings(self) -> dict[str, Recording]:
        results = self.metadata.get("results")
        path = self.path / "trace.csv" if results is None else Path(results)
        return {name: Recording(path, self.metadata, self.seen_by(name))
                for name in dict.fromkeys(one.calculator for one in self.passes)}

    def seen_by(self, calculator: str) -> list[CalculatedPass]:
        return [one for one in self.passes if one.calculator == calculator]


def read_run(path: Path, chosen: str | None = None, uncertainty: float | None = None) -> list[Thread]:
    """The threads of a run: of every start the pass that makes the final flank, or the pass that is ``chosen``.

    ``uncertainty`` is the standard one of the actual pitches, m; by default the verdict is that of the run.

    Raises:
        ReportError: the folder holds no run, a file in it is damaged, or there is no such pass.
    """
    if not (path / "pitch.csv").is_file():
        raise ReportError(f"{path}: is a folder without pitch.csv; give the folder of a run, or a log")
    folder = _Folder(path, read_pitches(path / "pitch.csv"), _read_json(path / "result.json"),
                     _read_json(path / METADATA))
    nominal = folder.seen_by(folder.passes[0].calculator)
    wanted = [one for one in nominal if _is_wanted(one, folder, chosen)]
    if not wanted and chosen is not None:
        raise ReportError(f"{path}: there is no pass {chosen}; the passes are "
                          f"{', '.join(str(one.number) for one in nominal)}")
    run = RecordedRun(folder.metadata, folder.passes, folder.recordings())
    threads = {one.number: run.thread(_described(folder, one), one, uncertainty) for one in wanted or nominal[-1:]}
    if uncertainty is not None:
        return list(threads.values())
    return [folder.judged(thread, number) for number, thread in threads.items()]


def _is_wanted(one: CalculatedPass, folder: _Folder, chosen: str | None) -> bool:
    if chosen is not None:
        return chosen in ("all", str(one.number))
    return bool(folder.told.get(one.number, {}).get("final_flank"))


def _described(folder: _Folder, one: CalculatedPass) -> Thread:
    """The thread of a pass, without what is seen of it elsewhere."""
    return Thread(
        f"{folder.path.name or folder.path.resolve().name}, pass {one.number}", one.table, one.target,
        one.chosen, tuple(_lines(one, folder.told.get(one.number, {}))),
        others=pass_overview(folder.seen_by(one.calculator)),
        provenance=(("run", str(folder.path)), *run_provenance(folder.metadata)))


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """What a run knows of its passes beside the pitches of one calculator: recordings, actual pitches, parameters."""

    metadata: Mapping[str, Any]
    passes: Sequence[CalculatedPass]
    recordings: Mapping[str, Recording]  # by calculator

    def thread(self, described: Thread, one: CalculatedPass, uncertainty: float | None = None) -> Thread:
        """The thread with its recordings, the actual pitches and the verdict on them."""
        samples, notes = self.recordings[one.calculator].samples(one)
        screw = self.metadata.get("settings", {}).get(_SCREW)
        thread = replace(described, samples=samples, notes=notes,
                         screw_lead=screw if isinstance(screw, float) and 0.0 < screw < 1.0 else None)
        actual = next((other for other in self.passes
                       if other.number == one.number and other.calculator != one.calculator), None)
        if actual is None:
            return replace(thread, notes=(*notes, "No verdict: the run has no calculator of the actual pitches"))
        pitch = np.where(actual.in_metal, actual.table.pitch, np.nan)
        groove = [MeasuredThread(row, start_angle=float(angle)) for row, angle
                  in zip(pitch, actual.table.start_angles, strict=True)]
        measured = tuple(replace(found, name=found.name.replace("measured", actual.calculator))
                         for found in laid_over(one.table, groove))
        thread = replace(thread, measured=measured, groove=self.recordings[actual.calculator].samples(actual)[0])
        return judged(thread, np.where(thread.chosen, one.table.pitch, np.nan), _of_shape(pitch, one.table.pitch.shape),
                      UNCERTAINTY if uncertainty is None else uncertainty)


def _of_shape(pitch: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """The same start angles and revolutions as the other table; NaN where there are none."""
    found = np.full(shape, np.nan)
    rows, turns = min(shape[0], pitch.shape[0]), min(shape[1], pitch.shape[1])
    found[:rows, :turns] = pitch[:rows, :turns]
    return found


def _lines(one: CalculatedPass, told: Mapping[str, Any]) -> list[str]:
    lines = [f"Nominal pitches by {one.calculator}, start {one.start_number}; target "
             f"{from_si(one.target, 'mm'):.6g} mm"]
    if told.get("kind") and isinstance(told.get("depth_mm"), float):
        lines.append(f"{told['kind']}, depth {told['depth_mm']:.4f} mm"
                     + (", makes the final flank" if told.get("final_flank") else ""))
    return lines


def pass_overview(passes: Sequence[CalculatedPass]) -> PassOverview:
    """All passes as one calculator saw them, each over its turns in the metal."""
    rows = []
    for one in passes:
        chosen = np.where(one.in_metal, one.table.pitch, np.nan)
        found = statistics((chosen if (~np.isnan(chosen)).any() else one.table.pitch).reshape(1, -1))
        rows.append((f"pass {one.number}", float(found.minimum[0]), float(found.maximum[0]), float(found.mean[0])))
    return PassOverview(tuple(rows))


def run_provenance(metadata: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How the run was made: versions, system, times, method, the content of every FMU, what was set."""
    names = ("threadpitch", "python", "numpy", "platform", "system", "start_time", "step_size", "steps", "engine")
    rows = [(name.replace("_", " "), f"{metadata[name]}") for name in names if name in metadata]
    for name in ("about", "method", "settings"):
        rows += [(f"{name}: {key}", f"{value}") for key, value in _items(metadata.get(name))]
    rows += [(f"FMU of {name}", f"{fmu.get('fmu')}, FMI {fmu.get('fmi')}, SHA-256 {fmu.get('sha256')}")
             for name, fmu in _items(metadata.get("components")) if isinstance(fmu, Mapping)]
    return rows


def _items(value: Any) -> list[tuple[str, Any]]:
    return list(value.items()) if isinstance(value, Mapping) else []


def _read_json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ReportError(f"{path}: cannot be read as JSON ({error}); run again") from None
    if not isinstance(document, dict):
        raise ReportError(f"{path}: holds no JSON object; run again")
    return document
