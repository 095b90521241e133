"""What a simulation leaves on disk and as JSON: trace, pitch table, the tables as text, the result document."""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from threadpitch.diagnosis import Diagnosis, diagnosis_document, diagnosis_lines
from threadpitch.lathe import Simulation
from threadpitch.measuring import write_measured
from threadpitch.passes import Pass
from threadpitch.tables import pass_text, pitch_record, start_angles_deg
from threadpitch.units import from_si

METADATA = "metadata.json"
FILES = ("trace.csv", "pitch.csv", "tables.txt", "result.json", METADATA)
MEASURED = "measured.csv"  # of a thread that was measured by a plan
_TEMPORARY = ".threadpitch-"
_CHOOSE = "choose another folder with --output"
HEADER = ("calculator", "pass", "start_number", "start_angle_deg", "n", "pitch_mm", "deviation_um", "in_metal")


def run_document(simulation: Simulation, found: Diagnosis | None = None) -> dict[str, object]:
    """The result as a JSON document: passes with P(n) in mm per start angle (null where a turn is missing), counts.

    Where the pitches were judged, ``verdict`` holds what was found.
    """
    return {
        "passes": [_pass_record(one) for one in simulation.passes],
        "alarm": simulation.alarm or None,
        "events": event_records(simulation),
        "steps": simulation.steps,
        "simulated_s": simulation.simulated,
        "wall_s": simulation.wall_time,
        "flavor": simulation.flavor,
        **({} if found is None else {"verdict": diagnosis_document(found)}),
    }


def event_records(simulation: Simulation) -> list[dict[str, object]]:
    """What the run waited for, and when it happened."""
    return [{"time_s": time, "variable": variable, "direction": direction}
            for time, variable, direction in simulation.result.events]


def check_folder(folder: str | Path, *others: Path | None) -> None:
    """Refuse a folder that cannot take a run, before the run instead of after it; nothing is left behind.

    ``others`` are files that the run writes besides.

    Raises:
        OSError: a file is in the way, one of the others has the name of a file of the folder, or the folder,
            or the one that it would be made in, cannot be written.
    """
    folder = Path(folder)
    for name in (*FILES, MEASURED):
        if (folder / name).is_dir():
            raise IsADirectoryError(f"{folder / name} is a folder; {_CHOOSE}")
        for other in others:
            if other is not None and other.resolve() == (folder / name).resolve():
                raise FileExistsError(f"{other}: {name} of this folder is another file of the run; choose another name")
    nearest = next((one for one in (folder, *folder.parents) if os.path.lexists(one)), Path())
    if not nearest.is_dir():
        raise NotADirectoryError(f"{nearest} is not a folder; {_CHOOSE}")
    try:
        os.rmdir(tempfile.mkdtemp(prefix=_TEMPORARY, dir=nearest))
    except OSError as error:
        raise _unwritable(folder, error) from None


def save_run(simulation: Simulation, folder: str | Path, found: Diagnosis | None = None) -> list[Path]:
    """Write ``trace.csv``, ``pitch.csv``, ``tables.txt``, ``result.json``, ``metadata.json`` into a folder (made if
    need be); the last tells how the run was made, and where its results are if they are not in ``trace.csv``.

    Besides ``measured.csv``, where the thread was measured.

    All are written aside first, so that the folder never holds half of a run; of a former run in the folder the
    files of these names are replaced, others stay. There is no ``trace.csv`` of a run whose results went to a file.

    Raises:
        OSError: the folder cannot be written.
    """
    folder = Path(folder)
    check_folder(folder)
    try:
        # Aside, but in the same file system, where moving is one operation: an existing folder may be a mount point.
        place = folder if folder.is_dir() else folder.parent
        place.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=place))
        try:
            _write_files(simulation, temporary, found)
            written = [name for name in (*FILES, MEASURED) if (temporary / name).exists()]
            if place is folder:
                for name in (*FILES, MEASURED):
                    if name in written:
                        os.replace(temporary / name, folder / name)
                    else:
                        (folder / name).unlink(missing_ok=True)
            else:
                temporary.chmod(0o755)  # mkdtemp makes folders that only their owner can enter
                os.replace(temporary, folder)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise _unwritable(folder, error) from error
    return [folder / name for name in written]


def _unwritable(folder: Path, error: OSError) -> OSError:
    return OSError(f"{folder}: cannot be written ({error.strerror or error}); {_CHOOSE}")


def _write_files(simulation: Simulation, folder: Path, found: Diagnosis | None) -> None:
    if simulation.result.path is None:
        simulation.result.save(folder)
    _write_pitches(simulation, folder / "pitch.csv")
    text = "\n".join(pass_text(one, simulation.beside(one)) for one in simulation.passes)
    verdict = "" if found is None else "\n" + "\n".join(diagnosis_lines(found)) + "\n"
    (folder / "tables.txt").write_text(text + verdict, encoding="utf-8")
    (folder / "result.json").write_text(json.dumps(run_document(simulation, found), indent=1) + "\n", encoding="utf-8")
    if found is not None and found.measured:
        write_measured(found.measured, folder / MEASURED)
    path = simulation.result.path
    made = {**simulation.result.metadata, "results": None if path is None else str(path.absolute())}
    (folder / METADATA).write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


def _pass_record(one: Pass) -> dict[str, object]:
    record: dict[str, object] = {"pass": one.number, "start_number": one.start_number, **_told(one),
                                 **pitch_record(one.table)}
    if one.effective is not None:
        for name, values in (("min", one.effective.minimum), ("max", one.effective.maximum),
                             ("mean", one.effective.mean)):
            record[f"effective_{name}_mm"] = [None if math.isnan(value) else from_si(float(value), "mm")
                                              for value in values]
    return record


def _told(one: Pass) -> dict[str, object]:
    """What the controller says of the pass; null where the system does not tell it."""
    lengths = {"depth_mm": one.depth, "lead_mm": one.lead, "groove_pitch_mm": one.pitch}
    told = {name: None if value is None else from_si(value, "mm") for name, value in lengths.items()}
    angle = None if one.start_angle is None else from_si(one.start_angle, "deg")
    return {"kind": one.kind, **told, "start_angle_deg": angle, "hand": one.hand, "final_flank": one.final_flank}


def _write_pitches(simulation: Simulation, path: Path) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for calculator in simulation.calculators:
            for one in simulation.passes_of(calculator):
                writer.writerows((calculator, *row) for row in _rows(one))


def _rows(one: Pass) -> Iterator[tuple[object, ...]]:
    for row, angle in enumerate(start_angles_deg(one.table)):
        for turn, pitch in enumerate(one.table.pitch[row].tolist()):
            if not math.isnan(pitch):
                yield (one.number, one.start_number, angle, turn + 1, from_si(pitch, "mm"),
                       from_si(float(one.deviation[row, turn]), "um"), int(one.in_metal[row, turn]))
