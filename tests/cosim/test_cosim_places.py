"""Where a run writes: what would destroy a file or lose the run is refused before it begins."""

from __future__ import annotations

import errno
import os
import re
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.cosim.ssd_text import ssd
from threadpitch.cosim import CosimError, read_checkpoint, read_system, resume, simulate
from threadpitch.cosim.archive import ArchiveError, unpack
from threadpitch.cosim.system import Component, System

SHORT: dict[str, Any] = {"stop_time": 0.2, "step_size": 0.01}


@pytest.fixture
def system(probe_fmu: Path) -> System:
    return System("two", (Component("a", probe_fmu), Component("b", probe_fmu)))


@pytest.mark.parametrize(("places", "message"), [
    ({"results": "rows.csv", "checkpoint": "rows.csv"}, r"rows\.csv: is to hold two things; choose another name"),
    ({"results": "rows.csv", "checkpoint": "rows.csv.json"}, r"rows\.csv\.json: is to hold two things"),
    ({"checkpoint": "folder"}, r"folder: is a folder; choose the name of a file"),
    ({"results": "folder.mat"}, r"folder\.mat: is a folder; choose the name of a file"),
    ({"checkpoint": "notes.txt"}, r"notes\.txt: is there, and is no checkpoint; choose another name, or remove it"),
    ({"checkpoint": "notes.txt/state"}, r"cannot be written \(not a directory\).*notes\.txt/state"),
    ({"checkpoint": "state", "checkpoint_every": -1.0}, "every -1 s is not possible; give 0 s or more"),
])
def test_places_that_do_not_fit_are_refused(system: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                            places: dict[str, Any], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("folder.mat").mkdir()
    Path("notes.txt").write_text("mine")
    before = sorted(tmp_path.iterdir())
    with pytest.raises((CosimError, OSError), match=message):
        simulate(system, **places, **{**SHORT, "stop_time": 1e9})  # for weeks, if it began
    assert sorted(tmp_path.iterdir()) == before
    assert Path("notes.txt").read_text() == "mine"


def test_what_the_run_reads_is_not_written_over(probe_fmu: Path, tmp_path: Path) -> None:
    (tmp_path / "Probe.fmu").write_bytes(probe_fmu.read_bytes())
    path = tmp_path / "one.ssd"
    path.write_text(ssd('<ssd:Elements><ssd:Component name="a" source="Probe.fmu"/></ssd:Elements>'))
    with read_system(path) as structure:
        for name in ("one.ssd", "Probe.fmu"):
            with pytest.raises(CosimError, match=rf"{name}: is a file that the run reads; choose another name"):
                simulate(structure, checkpoint=tmp_path / name, **SHORT)
    assert (tmp_path / "Probe.fmu").read_bytes() == probe_fmu.read_bytes()


def test_a_former_checkpoint_is_replaced(system: System, tmp_path: Path) -> None:
    for stop_time in (0.1, 0.2):
        simulate(system, checkpoint=tmp_path / "state", **{**SHORT, "stop_time": stop_time})
    assert read_checkpoint(tmp_path / "state").document["steps"] == 20


def test_parts_of_somebody_else_s_table_stay(system: System, tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow.parquet")
    folder = tmp_path / "rows.parquet"
    simulate(system, results=folder, **SHORT)
    simulate(system, results=folder, **SHORT)  # a former run of ours is replaced
    arrow.write_table(arrow.read_table(folder / "part-000000.parquet").replace_schema_metadata(),
                      folder / "part-0.parquet")
    (folder / "part-9.parquet").write_bytes(b"no table")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(CosimError, match=r"part-0\.parquet: comes from somewhere else; choose another folder"):
        simulate(system, results=folder, **SHORT)
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("name", ["rows.parquet", "rows.csv"])
def test_a_full_disk_is_told_with_the_file(system: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                           name: str) -> None:
    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match=rf"cannot be written \(no space left on device\); free some.*{name}"):
        simulate(system, results=tmp_path / name, checkpoint=tmp_path / "state", **SHORT)
    assert not list(tmp_path.glob("**/.*"))


def test_a_run_outlives_a_disk_that_takes_no_checkpoint(system: System, tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    simulate(system, checkpoint=tmp_path / "state", **{**SHORT, "stop_time": 0.1})
    before = (tmp_path / "state").read_bytes()
    monkeypatch.setattr(os, "fsync", full_disk)
    result = resume(tmp_path / "state", system=system, stop_time=0.2)
    assert result.steps == 20
    assert any("no checkpoint at step 20" in text and "no space left" in text for text in result.warnings)
    assert (tmp_path / "state").read_bytes() == before


def test_a_full_disk_is_not_the_archive_s_fault(probe_fmu: Path, tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(zipfile.ZipFile, "extractall", full_disk)
    message = (rf"Probe\.fmu: cannot be unpacked into {re.escape(str(tmp_path))} \(no space left on device\); free "
               "some space there, or name another folder in TMPDIR")
    with pytest.raises(ArchiveError, match=message):
        unpack(probe_fmu)
    assert not list(tmp_path.iterdir())
