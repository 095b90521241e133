"""The folder of a run -> the threads of a report."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.judgement import MeasuredThread
from threadpitch.pitch import statistics
from threadpitch.report.columns import read_columns
from threadpitch.report.content import EXACT, PassOverview, ReportError, Samples, Thread, judged, laid_over
from threadpitch.report.pitch_file import CalculatedPass, read_pitches
from threadpitch.run_folder import METADATA
from threadpitch.trace import TURN, FloatArray
from threadpitch.units import from_si

_NEAR = 1e-9  # turns: a start angle that is that of the edge itself
_SCREW = "z_drive.screw_lead"
# What a calculator of the lathe is connected with, for a run that does not tell.
_DEFAULT_SOURCES = {"spindle_angle": "spindle.encoder_angle", "feed_position": "z_drive.measured_position"}
_SPEED, _FOLLOWING_ERROR = "spindle.speed", "z_drive.following_error"


@dataclass(frozen=True, eq=False)
class _Folder:
    path: Path
    passes: list[CalculatedPass]
    told: dict[int, Mapping[str, Any]]  # by the pass's number, out of result.json
    metadata: Mapping[str, Any]

    def seen_by(self, calculator: str) -> list[CalculatedPass]:
        return [one for one in self.passes if one.calculator == calculator]


def is_run(path: Path) -> bool:
    """Whether this is the folder of a run."""
    return path.is_dir() and (path / "pitch.csv").is_file()


def read_run(path: Path, chosen: str | None = None, uncertainty: float | None = None) -> list[Thread]:
    """The threads of a run: of every start the pass that makes the final flank, or the pass that is ``chosen``.

    ``uncertainty`` is the standard one of the actual pitches, m; by default that of a groove that is known exactly.

    Raises:
        ReportError: the folder holds no run, a file in it is damaged, or there is no such pass.
    """
    folder = _Folder(path, read_pitches(path / "pitch.csv"), _read_told(path / "result.json"),
                     _read_json(path / METADATA) if (path / METADATA).is_file() else {})
    nominal = folder.seen_by(folder.passes[0].calculator)
    wanted = [one for one in nominal if _is_wanted(one, folder, chosen)]
    if not wanted and chosen is not None:
        raise ReportError(f"{path}: there is no pass {chosen}; the passes are "
                          f"{', '.join(str(one.number) for one in nominal)}")
    recording = _Recording(folder, nominal)
    return [_thread(folder, one, recording, uncertainty) for one in wanted or nominal[-1:]]


def _is_wanted(one: CalculatedPass, folder: _Folder, chosen: str | None) -> bool:
    if chosen is not None:
        return chosen in ("all", str(one.number))
    return bool(folder.told.get(one.number, {}).get("final_flank"))


def _thread(folder: _Folder, one: CalculatedPass, recording: _Recording, uncertainty: float | None) -> Thread:
    samples, notes = recording.samples(one)
    actual = [other for other in folder.passes if other.number == one.number and other.calculator != one.calculator]
    metadata, chosen = folder.metadata, one.in_metal & ~np.isnan(one.table.pitch)
    screw = metadata.get("settings", {}).get(_SCREW)
    thread = Thread(
        f"{folder.path.name or folder.path.resolve().name}, pass {one.number}", one.table, one.target,
        chosen if chosen.any() else ~np.isnan(one.table.pitch), tuple(_lines(one, folder.told.get(one.number, {}))),
        samples=samples, screw_lead=screw if isinstance(screw, float) and 0.0 < screw < 1.0 else None,
        others=_overview(folder.seen_by(one.calculator)), notes=notes,
        provenance=(("run", str(folder.path)), *_provenance(metadata)))
    if not actual:
        return replace(thread, notes=(*notes, "No verdict: the run has no calculator of the actual pitches"))
    pitch = np.where(actual[0].in_metal, actual[0].table.pitch, np.nan)
    groove = [MeasuredThread(row, start_angle=float(angle)) for row, angle
              in zip(pitch, actual[0].table.start_angles, strict=True)]
    measured = tuple(replace(found, name=found.name.replace("measured", actual[0].calculator))
                     for found in laid_over(one.table, groove))
    in_metal = np.where(thread.chosen, one.table.pitch, np.nan)
    return judged(replace(thread, measured=measured), in_metal, _of_shape(pitch, one.table.pitch.shape),
                  EXACT if uncertainty is None else uncertainty)


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


def _overview(passes: list[CalculatedPass]) -> PassOverview:
    rows = []
    for one in passes:
        chosen = np.where(one.in_metal, one.table.pitch, np.nan)
        found = statistics((chosen if (~np.isnan(chosen)).any() else one.table.pitch).reshape(1, -1))
        rows.append((f"pass {one.number}", float(found.minimum[0]), float(found.maximum[0]), float(found.mean[0])))
    return PassOverview(tuple(rows))


def _provenance(metadata: Mapping[str, Any]) -> list[tuple[str, str]]:
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


class _Recording:
    """The recorded columns of a run, from which the samples of its passes are cut; notes where that cannot be."""

    def __init__(self, folder: _Folder, nominal: list[CalculatedPass]) -> None:
        self._order = [one.number for one in nominal]
        self._columns: dict[str, FloatArray] = {}
        self._note = ""
        calculator = nominal[0].calculator
        links = folder.metadata.get("connections", [])
        self._sources = {target: next((link for link in links if link[1] == f"{calculator}.{target}"),
                                      (default, "", 1.0, 0.0)) for target, default in _DEFAULT_SOURCES.items()}
        self._threading, self._start = f"{calculator}.threading", f"{calculator}.threading_start"
        results = folder.metadata.get("results")
        path = folder.path / "trace.csv" if results is None else Path(results)
        try:
            self._columns = read_columns(path, [*(link[0] for link in self._sources.values()), self._threading,
                                                self._start, _SPEED, _FOLLOWING_ERROR])
        except (ReportError, OSError) as error:
            self._note = f"No recording: {path}: {error.strerror}" if isinstance(error, OSError) else f"{error}"
        needed = [*(link[0] for link in self._sources.values()), self._threading, self._start]
        missing = [name for name in needed if name not in self._columns]
        if missing and not self._note:
            self._note = f"No recording: {path} does not hold {', '.join(missing)}"

    def samples(self, one: CalculatedPass) -> tuple[Samples | None, tuple[str, ...]]:
        """The rows of a pass, from its first crossing of the first start angle on."""
        if self._note:
            return None, (self._note,)
        cuts = [cut for cut in self._cuts() if self._turn(cut, one)[-1] >= 1.0]
        if len(cuts) != len(self._order):
            return None, (f"No recording: {len(cuts)} passes in it, {len(self._order)} in the pitch table",)
        rows = cuts[self._order.index(one.number)]
        turn = self._turn(rows, one)
        position = self._of("feed_position", rows)
        position = position - np.interp(0.0, turn, position)
        error = self._columns.get(_FOLLOWING_ERROR)
        sense = -1.0 if position[-1] < 0.0 else 1.0
        speed = self._columns.get(_SPEED)
        return Samples(turn, sense * position, None if speed is None else speed[rows],
                       None if error is None else sense * error[rows]), ()

    def _cuts(self) -> list[slice]:
        """Rows of every stretch of threading, with one row before and one after."""
        threading = self._columns[self._threading] > 0.5
        edges = np.diff(np.concatenate(([0], threading.astype(np.int8), [0])))
        return [slice(max(int(begin) - 1, 0), int(end) + 1) for begin, end
                in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)]

    def _turn(self, rows: slice, one: CalculatedPass) -> FloatArray:
        """(rows,) revolutions from where n = 1 of the first start angle begins."""
        turn = np.maximum.accumulate(self._of("spindle_angle", rows)) / TURN
        begin = float(self._columns[self._start][rows][-2]) / TURN  # that of this pass: the row before may not have it
        start = float(one.table.start_angles[0]) / TURN
        return np.asarray(turn - (start + np.ceil(begin - start - _NEAR)))

    def _of(self, target: str, rows: slice) -> FloatArray:
        name, _, factor, offset = self._sources[target]
        return np.asarray(self._columns[name][rows] * factor + offset)


def _read_told(path: Path) -> dict[int, Mapping[str, Any]]:
    passes = _read_json(path).get("passes") if path.is_file() else None
    return {one["pass"]: one for one in passes if isinstance(one, dict) and isinstance(one.get("pass"), int)} \
        if isinstance(passes, list) else {}


def _read_json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ReportError(f"{path}: cannot be read as JSON ({error}); run again") from None
    if not isinstance(document, dict):
        raise ReportError(f"{path}: holds no JSON object; run again")
    return document
