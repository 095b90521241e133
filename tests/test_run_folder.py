"""What a run leaves on disk: the same numbers in every file, whole or not at all."""

from __future__ import annotations

import csv
import errno
import json
import math
import os
import re
import stat
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from threadpitch import cosim, lathe
from threadpitch.run_folder import FILES, HEADER, check_folder, run_document, save_run
from threadpitch.tables import pass_text


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def saved(short_run: lathe.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "a new one" / "inside another"
    assert save_run(short_run, folder) == [folder / name for name in FILES]
    return folder


def test_the_folder_holds_the_files_and_nothing_beside_them(saved: Path) -> None:
    assert names_in(saved) == set(FILES) == {"trace.csv", "pitch.csv", "tables.txt", "result.json", "metadata.json"}
    assert names_in(saved.parent) == {saved.name}


def test_rows_of_pitch_csv_are_the_pitches_of_the_document(saved: Path, short_run: lathe.Simulation) -> None:
    rows = rows_of(saved / "pitch.csv")
    assert tuple(rows[0]) == HEADER
    found: dict[float, list[float]] = defaultdict(list)
    for row in rows:
        if row["calculator"] == "nominal_pitch":
            assert (row["pass"], row["start_number"]) == ("1", "1")
            assert int(row["n"]) == len(found[float(row["start_angle_deg"])]) + 1
            found[float(row["start_angle_deg"])].append(float(row["pitch_mm"]))
            assert float(row["deviation_um"]) == pytest.approx(1e3 * (float(row["pitch_mm"]) - 1.5), abs=1e-9)
    document: Any = run_document(short_run)
    (one,) = document["passes"]
    assert list(found) == one["start_angles_deg"] == [0.0, 90.0, 180.0, 270.0]
    assert list(found.values()) == [[pitch for pitch in row if pitch is not None] for row in one["pitch_mm"]]
    assert {row["calculator"] for row in rows} == {"nominal_pitch", "actual_pitch"}


def test_effective_values_of_the_document_are_those_of_the_rows_in_the_metal(
        saved: Path, short_run: lathe.Simulation) -> None:
    document: Any = run_document(short_run)
    (one,) = document["passes"]
    for row, angle in enumerate(one["start_angles_deg"]):
        metal = [float(line["pitch_mm"]) for line in rows_of(saved / "pitch.csv")
                 if line["calculator"] == "nominal_pitch" and float(line["start_angle_deg"]) == angle
                 and line["in_metal"] == "1"]
        assert one["effective_min_mm"][row] == min(metal)
        assert one["effective_max_mm"][row] == max(metal)
        assert one["effective_mean_mm"][row] == pytest.approx(sum(metal) / len(metal), abs=1e-12)


def test_the_document_holds_its_keys_and_min_max_mean_of_its_pitches(short_run: lathe.Simulation) -> None:
    document: Any = run_document(short_run)
    assert set(document) >= {"passes", "steps", "simulated_s", "wall_s", "flavor"}
    assert (document["steps"], document["simulated_s"], document["flavor"]) == (1200, 1.2, lathe.choose_flavor())
    assert document["wall_s"] > 0.0
    (one,) = document["passes"]
    assert set(one) >= {"pass", "start_number", "start_angles_deg", "pitch_mm", "min_mm", "max_mm", "mean_mm"}
    for row, pitches in enumerate(one["pitch_mm"]):
        known = [pitch for pitch in pitches if pitch is not None]
        assert one["min_mm"][row] == min(known)
        assert one["max_mm"][row] == max(known)
        assert one["mean_mm"][row] == pytest.approx(math.fsum(known) / len(known), abs=1e-12)


def test_a_turn_that_one_start_angle_lacks_is_null(tmp_path: Path) -> None:
    result = lathe.simulate(start_angles=[0.0, 1.5 * math.pi], stop_time=0.8)
    (one,) = result.passes
    assert np.isnan(one.table.pitch).any()
    save_run(result, tmp_path / "out")
    document = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert any(pitch is None for row in document["passes"][0]["pitch_mm"] for pitch in row)
    rows = [row for row in rows_of(tmp_path / "out" / "pitch.csv") if row["calculator"] == "nominal_pitch"]
    assert len(rows) == np.count_nonzero(~np.isnan(one.table.pitch))


def test_result_json_is_the_document_and_tables_txt_the_tables(saved: Path, short_run: lathe.Simulation) -> None:
    assert json.loads((saved / "result.json").read_text(encoding="utf-8")) == run_document(short_run)
    one = short_run.passes[0]
    assert (saved / "tables.txt").read_text(encoding="utf-8") == pass_text(one, short_run.beside(one))


def test_the_statistics_of_the_actual_pitches_follow(saved: Path, short_run: lathe.Simulation) -> None:
    text = (saved / "tables.txt").read_text(encoding="utf-8").partition("By actual_pitch: turns ")[2]
    (other,) = short_run.beside(short_run.passes[0]).values()
    shown = other.table.statistics if other.effective is None or text.startswith("all") else other.effective
    values = (shown.maximum[0], shown.minimum[0], shown.mean[0])
    assert [f"{1e3 * value:.4f}" for value in values] == re.findall(r"\d\.\d{4}", text)[:3]
    assert values[0] != short_run.passes[0].table.maximum[0]


def test_the_trace_reads_back_bit_for_bit(saved: Path, short_run: lathe.Simulation) -> None:
    with (saved / "trace.csv").open(encoding="utf-8", newline="") as file:
        reader = csv.reader(file)
        header = next(reader)
        columns = dict(zip(header, np.array([[float(cell) for cell in row] for row in reader]).T, strict=True))
    np.testing.assert_array_equal(columns["time [s]"], short_run.time)
    np.testing.assert_array_equal(columns["spindle.angle [rad]"], short_run["spindle.angle"])
    np.testing.assert_array_equal(columns["controller.threading"], short_run["controller.threading"])
    assert len(columns) == len(short_run) + 1


def test_other_files_of_an_existing_folder_stay(short_run: lathe.Simulation, tmp_path: Path) -> None:
    (tmp_path / "notes.md").write_text("mine", encoding="utf-8")
    (tmp_path / "result.json").write_text("old", encoding="utf-8")
    save_run(short_run, tmp_path)
    assert names_in(tmp_path) == {*FILES, "notes.md"}
    assert (tmp_path / "notes.md").read_text(encoding="utf-8") == "mine"
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["steps"] == 1200


def test_an_existing_folder_may_be_another_file_system(short_run: lathe.Simulation, tmp_path: Path,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    mounted = tmp_path / "mounted"
    mounted.mkdir()
    replace = os.replace

    def replace_within(source: str | Path, target: str | Path) -> None:
        if (mounted in Path(source).parents) != (mounted in Path(target).parents):
            raise OSError(errno.EXDEV, "Invalid cross-device link")
        replace(source, target)

    monkeypatch.setattr(os, "replace", replace_within)
    save_run(short_run, mounted)
    assert names_in(mounted) == set(FILES)


@pytest.mark.parametrize("existing", [True, False])
def test_a_full_disk_leaves_what_was_there(short_run: lathe.Simulation, tmp_path: Path,
                                           monkeypatch: pytest.MonkeyPatch, existing: bool) -> None:
    folder = tmp_path / "out"
    if existing:
        folder.mkdir()
        (folder / "result.json").write_text("old", encoding="utf-8")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(cosim.Result, "_write_csv", full)
    with pytest.raises(OSError, match=r"out: cannot be written \(.*\); choose another folder with --output"):
        save_run(short_run, folder)
    assert names_in(tmp_path) == ({"out"} if existing else set())
    if existing:
        assert names_in(folder) == {"result.json"}
        assert (folder / "result.json").read_text(encoding="utf-8") == "old"


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no permission bits")
def test_others_may_read_what_was_written(saved: Path) -> None:
    assert stat.S_IMODE(saved.stat().st_mode) == 0o755
    assert stat.S_IMODE((saved / "trace.csv").stat().st_mode) == 0o644


def test_folders_that_cannot_take_a_run_are_refused_before_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    (tmp_path / "taken" / "pitch.csv").mkdir(parents=True)
    for folder, message in [("file", "file is not a folder"), ("file/in/it", "file is not a folder"),
                            ("taken", r"pitch\.csv is a folder")]:
        with pytest.raises(OSError, match=f"{message}; choose another folder with --output"):
            check_folder(tmp_path / folder)
    check_folder(tmp_path / "new" / "one")
    check_folder(tmp_path)
    monkeypatch.chdir(tmp_path)
    check_folder("new/one")
    assert names_in(tmp_path) == {"file", "taken"}


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder in which nobody can write")
def test_a_folder_that_nobody_can_write_is_refused_before_the_run() -> None:
    with pytest.raises(OSError, match=r"/proc/threadpitch: cannot be written \(.*\); choose another folder"):
        check_folder("/proc/threadpitch")


def test_a_run_without_a_turn_can_be_saved(tmp_path: Path) -> None:
    """As after Ctrl-C before threading began."""
    result = lathe.simulate(stop_time=0.1)
    save_run(result, tmp_path / "out")
    assert json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["passes"] == []
    assert rows_of(tmp_path / "out" / "pitch.csv") == []
    assert len(rows_of(tmp_path / "out" / "trace.csv")) == 101
