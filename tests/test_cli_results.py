"""Where a run's results go, and going on with it: the command line's side."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line
from threadpitch import lathe

ROOT = Path(__file__).parents[1]
QUICK = ("--stop-time", "0.7", "--start-angle", "0")
TABLES = ("pitch.csv", "tables.txt")


def header(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").partition("\n")[0].split(",")


@pytest.mark.parametrize("kind", ["rows.parquet", "rows.csv", "rows.mat"])
def test_results_go_to_a_file_and_the_turns_are_found(threadpitch: Command, workplace: Path, kind: str) -> None:
    """However few rows are recorded, the tables are those of all."""
    if kind.endswith("parquet"):
        pytest.importorskip("pyarrow")
    assert threadpitch("run", *QUICK).status == 0
    outcome = threadpitch("run", *QUICK, "--output", "other", "--results", kind, "--record", "spindle.speed",
                          "z_drive.p*", "--record-every", "100")
    assert (outcome.status, outcome.err) == (0, "")
    assert f"saved in other: pitch.csv, tables.txt, result.json, metadata.json, results in {kind}" in outcome.out
    assert (workplace / kind).exists()
    assert not (workplace / "other" / "trace.csv").exists()
    for name in TABLES:
        assert (workplace / "other" / name).read_bytes() == (workplace / "threadpitch-run" / name).read_bytes()


def test_what_is_recorded_is_chosen(threadpitch: Command, workplace: Path) -> None:
    assert threadpitch("run", *QUICK, "--record", "inputs", "z_drive.position", "--record-on",
                       "nominal_pitch.revolution[1]").status == 0
    names = header(workplace / "threadpitch-run" / "trace.csv")
    assert names[0] == "time [s]"
    assert "z_drive.position [m]" in names
    assert "z_drive.position_command [m]" in names
    assert "spindle.speed [rad/s]" not in names
    rows = (workplace / "threadpitch-run" / "trace.csv").read_text().splitlines()
    assert 2 < len(rows) < 6  # a header, the beginning, and the turns
    assert_one_line(threadpitch("run", *QUICK, "--record", "z_drive.positon").err, "did you mean z_drive.position")
    assert_one_line(threadpitch("run", *QUICK, "--record-every", "0").err, "give 1 or more")
    assert_one_line(threadpitch("run", *QUICK, "--results", "rows.xls").err, r"\.parquet, \.csv, \.mat")


def test_an_archive_goes_on_to_the_bits_of_one_run(threadpitch: Command, workplace: Path) -> None:
    from threadpitch.system_archive import FmuKind, build_system

    system = build_system(lathe.DEFAULT_SYSTEM, workplace, FmuKind(lathe.choose_flavor(), 2, None))
    common = (str(system), "--set", "controller.commanded_speed=700rpm", "--start-angle", "0", "90")
    assert threadpitch("run", *common, "--stop-time", "1").status == 0
    assert threadpitch("run", *common, "--stop-time", "0.7", "--output", "half", "--checkpoint", "state",
                       "--isolate", "spindle").status == 0
    outcome = threadpitch("resume", "state", "--stop-time", "1", "--output", "half", "--json")
    assert (outcome.status, outcome.err) == (0, "")
    assert json.loads(outcome.out)["steps"] == 1000
    for name in (*TABLES, "trace.csv"):
        assert (workplace / "half" / name).read_bytes() == (workplace / "threadpitch-run" / name).read_bytes()
    assert_one_line(threadpitch("resume", "missing").err, "missing: no such file")
    (workplace / "state").write_text("no")
    assert_one_line(threadpitch("resume", "state").err, "is not a readable checkpoint")


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGTERM")
def test_a_terminated_run_leaves_its_rows_and_goes_on(tmp_path: Path, threadpitch: Command,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    long = ("--stop-time", "60", "--start-angle", "0", "--record", "spindle.speed")
    (tmp_path / "temporary").mkdir()
    with subprocess.Popen(
            [sys.executable, "-m", "threadpitch", "run", *long, "--results", "rows.csv", "--checkpoint", "state",
             "--checkpoint-every", "0.1"], stderr=subprocess.PIPE, text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path / "temporary")}) as process:
        deadline = clock.monotonic() + 60.0
        while not (tmp_path / "state").exists():
            assert process.poll() is None
            assert clock.monotonic() < deadline
            clock.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        assert process.stderr is not None
        message = process.stderr.read()
    assert process.returncode == 128 + signal.SIGTERM
    assert_one_line(message, r"interrupted at t = .* s; what was recorded is in rows\.csv")
    assert not list((tmp_path / "temporary").iterdir())
    written = (tmp_path / "rows.csv").read_text()
    reached = float(message.split("t = ")[1].split(" s;")[0])
    assert float(written.splitlines()[-1].split(",")[0]) == pytest.approx(reached)
    stop = f"{reached + 0.5:.3f}"
    assert threadpitch("resume", "state", "--stop-time", stop, "--output", "rest").status in (0, 2)  # 2: no whole turn
    whole = lathe.simulate(stop_time=float(stop), start_angles=[0.0], record=["spindle.speed"])
    rows = np.loadtxt(tmp_path / "rows.csv", delimiter=",", skiprows=1)
    assert rows[:, 0].tobytes() == whole.time.tobytes()
    assert rows[:, 1].tobytes() == whole["spindle.speed"].tobytes()
    assert (tmp_path / "rows.csv").read_text().startswith(written)


@pytest.mark.parametrize(("arguments", "message"), [
    (("--results", "run/trace.csv"), "run/trace.csv: trace.csv of this folder is another file of the run"),
    (("--results", "run/pitch.csv"), "run/pitch.csv: pitch.csv of this folder is another file of the run"),
    (("--checkpoint", "run/result.json"), "run/result.json: result.json of this folder is another file of the run"),
    (("--checkpoint-every", "5"), "--checkpoint-every saves nothing without --checkpoint FILE; give one"),
])
def test_files_that_would_replace_each_other_are_refused(threadpitch: Command, workplace: Path,
                                                         arguments: tuple[str, ...], message: str) -> None:
    ended = threadpitch("run", "--output", "run", *arguments)
    assert ended.status == 2
    assert_one_line(ended.err, re.escape(message))
    assert not list(workplace.iterdir())
