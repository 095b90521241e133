"""The folder of a run as threads of a report."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as parquet
import pytest

from tests.report.made import samples_of
from threadpitch import lathe
from threadpitch.diagnosis import diagnose, diagnosis_document
from threadpitch.report.columns import read_columns
from threadpitch.report.content import ReportError
from threadpitch.report.recorded_run import read_run


@pytest.fixture
def copy(run_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(run_folder, tmp_path / "copy"))


def test_the_thread_is_that_of_the_simulation(run_folder: Path, short_run: lathe.Simulation) -> None:
    (thread,) = read_run(run_folder)
    (one,) = short_run.passes
    assert thread.nominal.pitch == pytest.approx(one.table.pitch, abs=1e-15, nan_ok=True)
    assert thread.target == pytest.approx(1.5e-3)
    assert (thread.chosen == (one.in_metal & ~np.isnan(one.table.pitch))).all()
    assert len(thread.measured) == 4
    assert dict(thread.provenance)["threadpitch"]
    assert thread.screw_lead == pytest.approx(10e-3)


def test_the_recordings_give_the_pitches_of_the_table(run_folder: Path, short_run: lathe.Simulation) -> None:
    (thread,) = read_run(run_folder)
    (actual,) = short_run.passes_of("actual_pitch")
    for samples, table in ((thread.samples, thread.nominal), (thread.groove, actual.table)):
        assert samples is not None
        turns = np.arange(0.0, np.floor(samples.turn[-1]) + 1.0)
        movement = np.diff(np.interp(turns, samples.turn, samples.position))
        assert movement == pytest.approx(table.pitch[0, :movement.size], abs=20e-9)
    speed = samples_of(thread).speed
    assert speed is not None
    assert speed.mean() == pytest.approx(500.0 * 2.0 * np.pi / 60.0, rel=0.01)


def test_the_verdict_is_that_of_the_run(copy: Path, short_run: lathe.Simulation) -> None:
    found = diagnose(short_run)
    assert found is not None
    result = copy / "result.json"
    control = {"shows": True, "sentences": ["60 %: the spindle drops", "40 %: the feed lags"]}
    told = diagnosis_document(found) | {"control": control}
    document = json.loads(result.read_text()) | {"verdict": told}
    result.write_text(json.dumps(document))
    (thread,) = read_run(copy)
    assert thread.verdict is not None
    assert thread.verdict.sentence == found.verdict.sentence
    assert thread.notes[-2:] == ("Where in the control: 60 %: the spindle drops",
                                 "Where in the control: 40 %: the feed lags")
    result.write_text(json.dumps(document | {"verdict": told | {"control": {"shows": False, "sentences": ["no"]}}}))
    assert not [note for note in read_run(copy)[0].notes if note.startswith("Where")]
    (other,) = read_run(copy, uncertainty=20e-6)
    assert other.verdict is not None
    assert other.verdict.evidence.uncertainty == 20e-6
    result.write_text(json.dumps(document | {"verdict": {"pass": 1}}))
    with pytest.raises(ReportError, match=r"result.json: the verdict is damaged"):
        read_run(copy)


def test_results_in_parquet_and_csv_are_read_alike(copy: Path) -> None:
    names = ("spindle.angle", "z_drive.following_error", "nominal_pitch.threading", "not.there")
    of_csv = read_columns(copy / "trace.csv", names)
    folder = copy / "rows.parquet"
    folder.mkdir()
    half = of_csv["spindle.angle"].size // 2
    for number, part in enumerate((slice(0, half), slice(half, None))):
        parquet.write_table(pa.table({name: values[part] for name, values in of_csv.items()}),
                            folder / f"part-{number:06d}.parquet")
    of_parquet = read_columns(folder, names)
    assert list(of_csv) == list(of_parquet) == list(names[:3])
    for name, values in of_csv.items():
        assert (values == of_parquet[name]).all()


def test_a_run_without_its_recording_keeps_pitches_and_verdict(copy: Path) -> None:
    (copy / "trace.csv").unlink()
    (thread,) = read_run(copy)
    assert thread.samples is None
    assert any("trace.csv: no such file" in note for note in thread.notes)
    assert thread.nominal.pitch.size


def test_a_recording_without_the_columns_is_noted(copy: Path) -> None:
    (copy / "trace.csv").write_text("time [s],spindle.angle [rad]\n0,0\n1,1\n")
    (thread,) = read_run(copy)
    assert thread.samples is None
    assert any("does not hold spindle.encoder_angle" in note for note in thread.notes)


def test_a_folder_of_an_older_run_without_metadata_is_read_too(copy: Path) -> None:
    (copy / "metadata.json").unlink()
    (copy / "result.json").unlink()
    (thread,) = read_run(copy)
    assert thread.samples is not None
    assert thread.screw_lead is None


def test_a_cut_off_recording_is_noted(copy: Path) -> None:
    text = (copy / "trace.csv").read_text()
    (copy / "trace.csv").write_text(text[:-900])
    (thread,) = read_run(copy)
    assert thread.samples is None
    assert any("damaged last line" in note for note in thread.notes)


@pytest.mark.parametrize(("name", "text", "message"), [
    ("pitch.csv", "a,b\n1,2\n", r"pitch\.csv:1: is not the pitch table"),
    ("pitch.csv", None, "without pitch.csv; give the folder"),
    ("result.json", "{", r"result\.json: cannot be read as JSON"),
    ("metadata.json", "[]", r"metadata\.json: holds no JSON object"),
])
def test_damaged_files_are_refused(copy: Path, name: str, text: str | None, message: str) -> None:
    if text is None:
        (copy / name).unlink()
    else:
        (copy / name).write_text(text)
    with pytest.raises(ReportError, match=message):
        read_run(copy)


@pytest.mark.parametrize("row", [
    "nominal_pitch,1,1,0.0,2,nan,0,1", "nominal_pitch,1,1,0.0,0,1.5,0,1", "x", "a,b,c,d,e,f,g,h",
    "nominal_pitch,1,1,0.0,99999999999,1.5,0,1"])
def test_a_damaged_row_of_the_pitch_table_is_told_with_its_line(copy: Path, row: str) -> None:
    header = (copy / "pitch.csv").read_text().splitlines()[0]
    (copy / "pitch.csv").write_text(f"{header}\nnominal_pitch,1,1,0.0,1,1.5,0,1\n{row}\n")
    with pytest.raises(ReportError, match=r"pitch\.csv:3: is no row"):
        read_run(copy)


def test_a_pass_is_chosen_by_its_number(copy: Path) -> None:
    lines = (copy / "pitch.csv").read_text().splitlines()
    second = [line.replace(",1,1,", ",2,1,", 1) for line in lines[1:]]
    (copy / "pitch.csv").write_text("\n".join([*lines, *second]) + "\n")
    document = json.loads((copy / "result.json").read_text())
    document["passes"][0]["final_flank"] = False
    document["passes"].append({**document["passes"][0], "pass": 2, "final_flank": True})
    (copy / "result.json").write_text(json.dumps(document))
    assert [thread.name for thread in read_run(copy)] == ["copy, pass 2"]
    assert [thread.name for thread in read_run(copy, "1")] == ["copy, pass 1"]
    both = read_run(copy, "all")
    assert len(both) == 2
    assert both[0].others is not None
    assert len(both[0].others.rows) == 2
    assert any("1 passes in it, 2 in the pitch table" in note for note in both[0].notes)
    with pytest.raises(ReportError, match="there is no pass 3; the passes are 1, 2"):
        read_run(copy, "3")
