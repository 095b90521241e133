"""A study is computed by workers that die, in parts, again and one row alone: the table stays the same to the bit."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from tests.benchmarks.bench_killed_workers import definition, own_workers
from tests.conftest import Command
from threadpitch import simulate, studies
from threadpitch.diagnosis import diagnose
from threadpitch.faults import read_fault
from threadpitch.store import open_store
from threadpitch.studies import Place, StudyError, study
from threadpitch.studies.cluster import job_queue
from threadpitch.studies.evaluation import Evaluator

ROOT = Path(__file__).parent.parent.parent
HERE = Place(workers=0)
FORMULA: dict[str, Any] = {"study": {"system": "none"}, "parameters": {"a": [1, 2, 3, 4, 5]},
                           "outcomes": {"y": "a ** 2", "root": "sqrt(3 - a)"}}


def test_workers_that_are_killed_lose_nothing(tmp_path: Path) -> None:
    """Short; ``python -m tests.benchmarks.bench_killed_workers`` has 2,000 rows."""
    quiet = study(definition(80), output=tmp_path / "quiet", place=HERE)
    assert quiet.complete
    killed: list[int] = []

    def kill_once(done: int, rows: int) -> None:
        if done > 10 and not killed:
            worker = own_workers()[0]
            killed.append(worker.pid)
            worker.kill()

    disturbed = study(definition(80), output=tmp_path / "disturbed", place=Place(workers=2), progress=kill_once)
    assert killed
    assert disturbed.table.equals(quiet.table, check_metadata=True)
    number = 17
    parameters, outcome = studies.row(definition(80), number)
    assert {**outcome.values, **parameters} == {name: quiet.table[name][number].as_py()
                                                for name in (*outcome.values, *parameters)}
    simulation = simulate(parameters={**parameters}, stop_time=0.4, flavor="native")
    assert simulation["spindle.angle"][-1] == outcome.values["angle"]


def test_a_row_that_fails_says_why_and_the_rest_goes_on(tmp_path: Path) -> None:
    result = study(FORMULA, output=tmp_path, place=HERE)
    assert result.complete
    assert result.table["status"].to_pylist() == ["ok", "ok", "ok", "failed", "failed"]
    assert result.table["reason"].to_pylist()[3] == "outcome root is not a number (NaN)"
    assert result.table["y"].to_pylist() == [1.0, 4.0, 9.0, None, None]
    assert result.analysis.failed == 2
    assert pyarrow.parquet.read_table(tmp_path / "study.parquet").equals(result.table, check_metadata=True)
    provenance = json.loads(result.table.schema.metadata[b"threadpitch"])
    assert {"digest", "numpy", "python", "rows", "seed", "study", "threadpitch"} <= provenance.keys()


def test_a_study_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    def stop_at(count: int) -> Callable[[int, int], None]:
        def told(done: int, rows: int) -> None:
            if done == count:
                raise KeyboardInterrupt
        return told

    with pytest.raises(KeyboardInterrupt):
        study(FORMULA, output=tmp_path / "one", place=HERE, progress=stop_at(2))
    assert not (tmp_path / "one" / "study.parquet").exists()
    told: list[int] = []
    result = study(FORMULA, output=tmp_path / "one", place=HERE, progress=lambda done, rows: told.append(done))
    assert told == [3, 4, 5]
    assert result.table.equals(study(FORMULA, output=tmp_path / "other", place=HERE).table, check_metadata=True)


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_keeps_what_workers_have_done(tmp_path: Path) -> None:
    """A real signal to the command with a worker: status 130, no traceback, and the same table when it goes on."""
    file = tmp_path / "study.toml"
    file.write_text('[study]\nsystem = "none"\ndesign = "random"\nsamples = 20000\nseed = 1\n[parameters]\n'
                    'a = { from = 0, to = 1 }\n[outcomes]\n'
                    + "".join(f'y{k} = "sin({k} * a) ** 2"\n' for k in range(9)))
    process = subprocess.Popen(
        [sys.executable, "-m", "threadpitch", "study", str(file), "--workers", "1", "--output", str(tmp_path / "o")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        while not list((tmp_path / "o" / "rows").glob("part-*")):
            assert process.poll() is None, process.communicate()
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: workers get it too
        told = process.communicate(timeout=60)[1]
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130, told
    assert "Traceback" not in told
    kept = [pyarrow.parquet.read_table(part).num_rows for part in (tmp_path / "o" / "rows").glob("part-*")]
    assert 0 < sum(kept) < 20000
    missing: list[int] = []
    again = study(file, output=tmp_path / "o", place=HERE, progress=lambda done, rows: missing.append(done))
    assert len(missing) == 20000 - sum(kept)
    assert again.table.equals(study(file, output=tmp_path / "whole", place=HERE).table, check_metadata=True)


def test_shards_make_the_whole(tmp_path: Path) -> None:
    parts = [study(FORMULA, output=tmp_path / "parts", place=Place(shard=(number, 3))) for number in (3, 1, 2)]
    assert [one.complete for one in parts] == [False, False, True]
    whole = study(FORMULA, output=tmp_path / "whole", place=HERE)
    assert parts[-1].table.equals(whole.table, check_metadata=True)


def test_failed_rows_are_computed_once_more_when_asked(tmp_path: Path) -> None:
    study(FORMULA, output=tmp_path, place=HERE)
    told: list[int] = []
    study(FORMULA, output=tmp_path, place=HERE, progress=lambda done, rows: told.append(done))
    assert not told
    study(FORMULA, output=tmp_path, place=HERE, retry_failed=True, progress=lambda done, rows: told.append(done))
    assert len(told) == 2


def test_a_folder_holds_one_study(tmp_path: Path) -> None:
    study(FORMULA, output=tmp_path, place=HERE)
    with pytest.raises(StudyError, match="holds rows of another study"):
        study({**FORMULA, "outcomes": {"y": "a ** 3"}}, output=tmp_path, place=HERE)
    relaxed = study({**FORMULA, "limits": {"y": 5}}, output=tmp_path, place=HERE)  # limits are looked at afterwards
    assert relaxed.analysis.yields["y"].value == pytest.approx(0.4)
    part = next((tmp_path / "rows").iterdir())
    part.write_bytes(part.read_bytes()[:100])
    with pytest.raises(StudyError, match=r"cannot be read .* remove it"):
        study(FORMULA, output=tmp_path, place=HERE)


@pytest.mark.parametrize(("changed", "why"), [
    ({"study": {"system": "nowhere"}}, "no such file or folder"),
    ({"parameters": {"z_drive.gain": [1, 2]}}, "has no variable 'gain'"),
    ({"parameters": {"z_drive.position_gain": [1, -2]}}, ""),
    ({"outcomes": {"y": "max(z_drive.positio)"}}, "nothing to record is called"),
    ({"outcomes": {"y": "max(z_drive.position"}}, "is no expression"),
    ({"outcomes": {"y": 3}}, "is no expression"),
    ({"outcomes": {"a b": "1"}}, "is no name"),
    ({"limits": {"z": 3}}, "no outcome is called 'z'"),
    ({"nonsense": {}}, "'nonsense' is not known"),
])
def test_what_is_wrong_is_told_before_anything_is_computed(
        tmp_path: Path, changed: dict[str, Any], why: str) -> None:
    document = {"study": {"stop_time": 0.3, "pitch_limit": "5um"}, "parameters": {"z_drive.position_gain": [40]},
                "outcomes": {"y": "last(z_drive.position)"}, **changed}
    if not why:
        result = study(document, output=tmp_path, place=HERE)
        assert result.table["status"].to_pylist() == ["ok", "failed"]
        assert "below the minimum" in result.table["reason"].to_pylist()[1]
        return
    with pytest.raises(ValueError, match=why):
        study(document, output=tmp_path / "out", place=HERE)
    assert not (tmp_path / "out").exists()


def test_statistics_of_a_thread(tmp_path: Path) -> None:
    document = {"study": {"stop_time": 4.0, "pitch_limit": "2um", "start_angles_deg": [0, 90]},
                "parameters": {"z_drive.position_gain": [50]},
                "outcomes": {"worst": "actual.max_deviation", "share": "actual.share_out_of_limit", "cause": "cause",
                             "first": "nominal.first_good_turn", "turns": "nominal.turns"}}
    result = study(document, output=tmp_path, place=HERE)
    found = result.table.to_pylist()[0]
    passes = simulate(start_angles=(0.0, 1.5707963267948966), parameters={"z_drive.position_gain": 50.0}).passes_of(
        "actual_pitch")[0]
    inside = abs(passes.deviation[passes.in_metal])
    assert found["worst"] == inside.max()
    assert found["share"] == pytest.approx((inside > 2e-6).mean())
    assert found["cause"] == "mechanical"
    assert 1 <= found["first"] <= found["turns"] <= 20


@pytest.mark.parametrize("given", [
    {"controller.taper": "-0.4mm", "controller.z_end": "-12mm", "controller.x_surface": 0.0101},
    dict(read_fault("hard_spot").parameters),
], ids=["tapered", "fault"])
def test_a_row_is_what_run_gives(tmp_path: Path, given: dict[str, Any]) -> None:
    """Parameters, fixed or varied, in words or SI: pitches, groove and cause are those of a simulation by itself."""
    varied = {"z_drive.position_gain": [20, 40], "controller.commanded_speed": ["700rpm"]}
    document = {"study": {"stop_time": 2.2, "start_angles_deg": [0, 90]}, "parameters": varied, "fixed": given,
                "outcomes": {"worst": "actual.max_deviation", "cause": "cause",
                             "chip": "max(cutting.chip_thickness[1])", "depth": "max(cutting.groove_depth)",
                             "torque": "sum(cutting.torque)"}}
    rows = study(document, output=tmp_path, place=HERE).table.to_pylist()
    for row in rows:
        alone = simulate(parameters={**given, **{name: row[name] for name in varied}}, stop_time=2.2,
                         start_angles=(0.0, math.radians(90.0)))
        verdict, groove = diagnose(alone), alone.passes_of("actual_pitch")[0]
        assert verdict is not None
        assert row["cause"] == verdict.verdict.cause
        assert row["worst"] == abs(groove.deviation[groove.in_metal]).max()
        assert row["chip"] == alone["cutting.chip_thickness[1]"].max()
        assert row["depth"] == alone["cutting.groove_depth"].max()
        assert row["torque"] == alone["cutting.torque"].sum()
    assert rows[0]["worst"] != rows[1]["worst"]


def test_examples_are_studies() -> None:
    page = (ROOT / "docs" / "studies.md").read_text(encoding="utf-8")
    example = re.findall(r"^```toml\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[0]
    assert len(studies.study_of(tomllib.loads(example)).rows) == 256
    for path in sorted((ROOT / "models" / "studies").glob("*.toml")):
        with Evaluator(studies.read_study(path)) as evaluator:
            evaluator.check()
    with pytest.raises(StudyError, match="no such file"):
        studies.read_study("models/studies/nothing.toml")


def test_a_study_is_kept_in_the_store_once(tmp_path: Path, threadpitch: Command) -> None:
    definition_file = tmp_path / "study.toml"
    definition_file.write_text('[study]\nsystem = "none"\n[parameters]\na = [1, 2]\n[outcomes]\ny = "a"\n')
    for _ in range(2):
        told = threadpitch("study", definition_file, "--workers", 0, "--output", tmp_path / "out", "--store",
                           tmp_path / "runs.db", "--json")
        assert json.loads(told.out)["stored"]["run"] == 1
    with open_store(str(tmp_path / "runs.db")) as store:
        assert [run.kind for run in store.runs()] == ["study"]
        run = store.run(1)
        assert run.provenance["analysis"]["rows"] == 2
        assert not store.verify()


def test_workers_of_a_scheduler_that_runs_already(tmp_path: Path) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0",
                      scheduler_kwargs={"dashboard": False}) as cluster:
        found = study(FORMULA, output=tmp_path / "there", place=Place(scheduler=cluster.scheduler_address))
    assert found.table.equals(study(FORMULA, output=tmp_path / "here", place=HERE).table, check_metadata=True)


def test_a_queue_gets_jobs_of_workers() -> None:
    with job_queue({"kind": "slurm", "jobs": 4, "cores": 2, "memory": "4GB", "walltime": "01:00:00",
                    "queue": "short", "interface": "lo"}) as cluster:
        script = cluster.job_script()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert "#SBATCH -p short" in script
    assert "#SBATCH -t 01:00:00" in script
    assert "distributed.cli.dask_worker" in script
    with pytest.raises(StudyError, match="did you mean slurm"):
        job_queue({"kind": "slurn"})
    with pytest.raises(StudyError, match=r"\[cluster\]"):
        job_queue({"kind": "slurm", "nonsense": 3})


def test_command(threadpitch: Command, workplace: Path) -> None:
    Path("study.toml").write_text('[study]\nsystem = "none"\ndesign = "sobol"\nsamples = 32\n[parameters]\n'
                                  'a = { from = 0, to = 1 }\n[outcomes]\ny = "a ** 2"\n[limits]\ny = 0.25\n')
    dry = threadpitch("study", "study.toml", "--dry-run", "--json")
    assert json.loads(dry.out)["missing"] == 32
    assert not Path("threadpitch-study").exists()
    part = threadpitch("study", "study.toml", "--shard", "1/2")
    assert part.status == 3
    assert "16 rows are still missing" in part.out
    whole = threadpitch("study", "study.toml", "--workers", "0", "--plot", "y.svg")
    assert whole.status == 0
    assert "Study study: 32 of 32 rows" in whole.out
    assert "50.00 %" in whole.out
    assert Path("y.svg").read_text(encoding="utf-8").startswith("<?xml")
    row = json.loads(threadpitch("study", "study.toml", "--row", 3, "--json").out)
    assert row["outcomes"]["y"]["si"] == row["parameters"]["a"]["si"] ** 2
    for arguments, why in ((["nowhere.toml"], "no such file"), (["study.toml", "--shard", "3/2"], "write it like 2/8"),
                           (["study.toml", "--row", "99"], "there is no row 99"),
                           (["study.toml", "--queue"], "[cluster]")):
        refused = threadpitch("study", *arguments)
        assert refused.status == 2, arguments
        assert why in refused.err
        assert refused.err.count("\n") == 1


def test_status_tells_of_rows_that_failed(threadpitch: Command, workplace: Path) -> None:
    """All: 2, one line, and what was computed is kept. Some: 0, and how many."""
    Path("study.toml").write_text('[study]\nsystem = "none"\n[parameters]\na = [2, 4, 5]\n[outcomes]\n'
                                  'root = "sqrt(3 - a)"\n')
    some = threadpitch("study", "study.toml", "--workers", 0, "--output", "some")
    assert some.status == 0
    assert "Study study: 3 of 3 rows, 2 of them failed" in some.out
    assert "row 1 and 1 more: outcome root is not a number (NaN)" in some.out
    Path("study.toml").write_text('[study]\nsystem = "none"\n[parameters]\na = [4, 5]\n[outcomes]\n'
                                  'root = "sqrt(3 - a)"\n')
    for arguments, how_many in ((["--shard", "1/2"], "so far all 1 rows"), (["--json"], "all 2 rows")):
        told = threadpitch("study", "study.toml", "--workers", 0, "--output", "all", *arguments)
        assert (told.status, told.out, told.err.count("\n")) == (2, "", 1)
        assert f"study.toml: {how_many} failed, row 0" in told.err
        assert "outcome root is not a number (NaN); they are kept in all; mend" in told.err
    assert Path("all/study.parquet").is_file()
