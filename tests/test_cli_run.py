"""``threadpitch run``: what it prints and what it leaves on disk."""

from __future__ import annotations

import contextlib
import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.conftest import Command
from threadpitch import lathe
from threadpitch.cli import invoke
from threadpitch.run_folder import FILES

QUICK = ("--stop-time", "0.6", "--start-angle", "0")


class DefaultRun(NamedTuple):
    """``threadpitch run --json`` and the folder that it wrote."""

    document: dict[str, Any]
    folder: Path


@pytest.fixture(scope="module")
def default_run(tmp_path_factory: pytest.TempPathFactory, fmu_cache: None) -> DefaultRun:
    folder = tmp_path_factory.mktemp("run")
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        assert invoke(["run", "--json"]) == 0
    assert err.getvalue() == ""
    return DefaultRun(json.loads(out.getvalue()), folder / "threadpitch-run")


def test_the_default_run_cuts_a_thread_of_one_and_a_half_millimetres(default_run: DefaultRun) -> None:
    document = default_run.document
    assert set(document) >= {"passes", "steps", "simulated_s", "wall_s", "flavor"}
    assert (document["steps"], document["simulated_s"], document["flavor"]) == (4000, 4.0, lathe.choose_flavor())
    (one,) = document["passes"]
    assert set(one) >= {"pass", "start_number", "start_angles_deg", "pitch_mm", "min_mm", "max_mm", "mean_mm"}
    assert (one["pass"], one["start_number"], one["start_angles_deg"]) == (1, 1, [0.0, 90.0, 180.0, 270.0])
    assert [len(row) for row in one["pitch_mm"]] == [23] * 4  # 36 mm of travel less the last, broken turn
    for name in ("min_mm", "max_mm", "mean_mm"):
        assert len(one[name]) == 4
        assert one[f"effective_{name}"] == pytest.approx([1.5] * 4, abs=1e-3)


def test_the_folder_agrees_with_standard_output(default_run: DefaultRun) -> None:
    assert {path.name for path in default_run.folder.iterdir()} == set(FILES)
    assert {path.name for path in default_run.folder.parent.iterdir()} == {default_run.folder.name}
    assert json.loads((default_run.folder / "result.json").read_text(encoding="utf-8")) == default_run.document


def test_tables_of_a_run(threadpitch: Command, workplace: Path) -> None:
    outcome = threadpitch("run", "--stop-time", 1.2)
    assert (outcome.status, outcome.err) == (0, "")
    tables = (workplace / "threadpitch-run" / "tables.txt").read_text(encoding="utf-8")
    pitches, verdict = (" ".join(part.split()) for part in tables.split("\nVerdict"))
    printed = " ".join(outcome.out.split())
    assert printed.startswith(pitches)
    assert f"Verdict {verdict}" in printed
    lines = outcome.out.splitlines()
    assert lines[0] == "Pass 1, start 1"
    assert "| angle [deg] | n [rev] |    0 deg |   90 deg |  180 deg |  270 deg |" in lines
    assert sum(re.match(r"\| +\d+ \| +\d+ \| +1\.\d{4} \|", line) is not None for line in lines) == 7
    assert sum(line.startswith("|  theta_S2 = 90 deg |") for line in lines) == 3  # all turns, in the metal, actual
    metal = next(n for n, line in enumerate(lines) if line.startswith("Effective thread"))
    assert " ".join(lines[metal:metal + 2]) == (
        "Effective thread: turns in the metal, 0 deg: n = 6 to 7; 90 deg: n = 5 to 7; 180 deg: n = 5 to 7; "
        "270 deg: n = 5 to 7")
    assert re.fullmatch(r"1200 steps, 1\.2 s simulated in \d+\.\d\d s with (native|python) FMUs", lines[-2])
    assert lines[-1] == "saved in threadpitch-run: trace.csv, pitch.csv, tables.txt, result.json, metadata.json"


def test_several_values_follow_one_option(threadpitch: Command, workplace: Path) -> None:
    outcome = threadpitch("run", "--start-angle", "0", "90", "-90", "--set", "controller.lead=2mm",
                          "nominal_pitch.pitch_target=2mm", "threading_lathe", "--stop-time", "0.9", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    (one,) = json.loads(outcome.out)["passes"]
    assert one["start_angles_deg"] == [0.0, 90.0, -90.0]
    assert one["pitch_mm"][1][-1] == pytest.approx(2.0, abs=2e-3)


@pytest.mark.parametrize("arguments", [
    ("--start-angle", "0", "--start-angle", "90"),
    ("--start-angle=0", "90"),
    ("--start-angle", "0", "+90", "threading_lathe"),
    ("--start-angle", "0.0", "9e1", "--", "threading_lathe"),
])
def test_ways_to_write_several_values(threadpitch: Command, workplace: Path, arguments: tuple[str, ...]) -> None:
    outcome = threadpitch("run", "--json", "--stop-time", "0.6", *arguments)
    assert (outcome.status, outcome.err) == (0, "")
    assert json.loads(outcome.out)["passes"][0]["start_angles_deg"] == [0.0, 90.0]


def test_set_wins_over_files_and_later_files_over_earlier_ones(threadpitch: Command, workplace: Path) -> None:
    (workplace / "one.toml").write_text('[nominal_pitch]\npitch_target = "3mm"\nsample_interval = "20deg"\n')
    (workplace / "two.json").write_text('{"nominal_pitch.pitch_target": "4mm", "spindle.initial_angle": "90deg"}')
    outcome = threadpitch("run", *QUICK, "--parameters", "one.toml", "--parameters", "two.json", "--set",
                          "spindle.initial_angle=0.5", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    trace = (workplace / "threadpitch-run" / "trace.csv").read_text(encoding="utf-8").splitlines()
    first = dict(zip(trace[0].split(","), trace[1].split(","), strict=True))
    assert float(first["spindle.angle [rad]"]) == 0.5
    assert float(first["nominal_pitch.pitch_target [m]"]) == 4e-3


def test_output_folders_of_any_name(threadpitch: Command, workplace: Path) -> None:
    folder = workplace / "Gewinde 20×1,5 [ä]" / "ねじ"
    outcome = threadpitch("run", *QUICK, "--output", folder)
    assert (outcome.status, outcome.err) == (0, "")
    assert {path.name for path in folder.iterdir()} == set(FILES)
    assert f"saved in {folder}: trace.csv" in outcome.out
    assert {path.name for path in workplace.iterdir()} == {folder.parent.name}


def test_a_system_from_another_folder_or_an_archive(threadpitch: Command, workplace: Path) -> None:
    own = workplace / "own lathe"
    (own / "resources").mkdir(parents=True)
    shipped = lathe.shipped("models") / "threading_lathe"
    for path in ("SystemStructure.ssd", "resources/lathe.ssv", "resources/M20x1.5.ssv"):
        (own / path).write_bytes((shipped / path).read_bytes())
    with zipfile.ZipFile(workplace / "own.ssp", "w") as archive:
        for file in own.rglob("*"):
            archive.write(file, file.relative_to(own))
    documents = []
    for system in ("own lathe", "own lathe/SystemStructure.ssd", "own.ssp", "models/threading_lathe"):
        outcome = threadpitch("run", system, *QUICK, "--json")
        assert outcome.status == 0, system
        if system.endswith(".ssp"):  # which people send around: they are told what ran in place of what it lacks
            assert "SpindleDrive" in outcome.err
            assert all(line.startswith("threadpitch: ") for line in outcome.err.splitlines())
        else:
            assert outcome.err == "", system
        documents.append(json.loads(outcome.out)["passes"])
    assert all(passes == documents[0] for passes in documents)


def test_an_existing_folder_is_written_again_and_keeps_other_files(threadpitch: Command, workplace: Path) -> None:
    folder = workplace / "threadpitch-run"
    folder.mkdir()
    (folder / "notes.md").write_text("mine")
    for stop in ("0.6", "0.7"):
        assert threadpitch("run", "--stop-time", stop).status == 0
    assert {path.name for path in folder.iterdir()} == {*FILES, "notes.md"}
    assert json.loads((folder / "result.json").read_text())["simulated_s"] == 0.7


def test_a_failing_run_leaves_the_former_one(threadpitch: Command, workplace: Path) -> None:
    assert threadpitch("run", *QUICK).status == 0
    before = {path.name: path.read_bytes() for path in (workplace / "threadpitch-run").iterdir()}
    for arguments in (("--stop-time", "0"), ("--step-size", "0.2"), ("--set", "z_drive.nosuch=1")):
        assert threadpitch("run", *arguments).status == 2
    assert {path.name: path.read_bytes() for path in (workplace / "threadpitch-run").iterdir()} == before


@pytest.mark.parametrize(("stop", "message"), [
    (0.1, r"no threading until the stop at 0\.1 s; the spindle reached \d+ of 500 rpm; choose a longer "),
    (0.3, r"no whole turn until the stop at 0\.3 s: threading began at 0\.\d+ s; choose a longer "),
])
def test_a_run_without_a_turn_is_saved(threadpitch: Command, workplace: Path, stop: float, message: str) -> None:
    done = threadpitch("run", "--stop-time", stop)
    assert done.status == 2
    assert done.err.count("\n") == 1
    assert re.search(message, done.err)
    assert done.err.endswith("; what was computed until then is saved in threadpitch-run\n")
    folder = workplace / "threadpitch-run"
    assert json.loads((folder / "result.json").read_text())["passes"] == []
    # The header, and a row after every step of 1 ms.
    assert len((folder / "trace.csv").read_text().splitlines()) == round(1000 * stop) + 2


def test_warnings_of_fmus_go_to_standard_error(threadpitch: Command, workplace: Path, short_run: lathe.Simulation,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lathe, "simulate", lambda *_, **__: short_run)
    monkeypatch.setattr(short_run.result, "warnings", ("spindle: the belt\nslips \x1b[31m",))
    for options in ((), ("--json",)):
        outcome = threadpitch("run", *options)
        assert outcome.status == 0
        assert outcome.err == "threadpitch: warning: spindle: the belt slips ?[31m\n"
        assert "belt" not in outcome.out


def test_ctrl_c_outside_of_the_simulation(threadpitch: Command, workplace: Path,
                                          monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(lathe, "simulate", interrupted)
    assert threadpitch("run") == (130, "", "threadpitch: interrupted\n")
    assert list(workplace.iterdir()) == []
