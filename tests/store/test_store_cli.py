"""``threadpitch store``: find last week's part, look at it, take it out, and see that nothing is wrong."""

from __future__ import annotations

import csv
import gzip
import json
import operator
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.store import open_store
from threadpitch.trace import ColumnChoice, read_groups

LOGS = Path(__file__).parents[2] / "models" / "logs" / "linuxcnc"
LOG = LOGS / "J_twostart_400.csv.gz"
HOSTILE = "\x1b[31m'; DROP TABLE runs; --"


@pytest.fixture
def kept(workplace: Path, threadpitch: Command) -> Path:
    """A store with two analysed logs."""
    for serial, more in (("S-1", ()), ("S-2", ("--start-angle", "0", "90", "--target", "3"))):
        done = threadpitch("analyze", LOG, "--store", "runs.db", "--serial", serial, "--machine", HOSTILE,
                           "--program-name", "../../O1", "--note", "=1+1", *more)
        assert (done.status, done.err) == (0, "")
        assert done.out.splitlines()[-1].startswith("kept as run ")
    return workplace / "runs.db"


def test_list_finds_and_shows_names_as_text(kept: Path, threadpitch: Command) -> None:
    shown = threadpitch("store", "list", "--store", "runs.db")
    assert "2 of 2 runs in" in shown.out
    assert "\x1b" not in shown.out
    found = json.loads(threadpitch("store", "list", "s-2", "--store", "runs.db", "--json").out)
    assert [run["serial_number"] for run in found["runs"]] == ["S-2"]
    assert found["runs"][0]["machine"] == HOSTILE
    assert found["runs"][0]["statistics"][0]["target_mm"] == 3.0
    for option, value, count in (("--serial", "S-1", 1), ("--machine", "x", 0), ("--since", "2020-01-01", 2),
                                 ("--until", "2020-01-01", 0), ("--limit", "1", 1)):
        found = json.loads(threadpitch("store", "list", option, value, "--store", "runs.db", "--json").out)
        assert len(found["runs"]) == count, option


def test_a_store_of_any_name_is_the_one_that_is_listed(kept: Path, threadpitch: Command) -> None:
    kept.rename("archive")
    assert "2 of 2 runs in" in threadpitch("store", "list", "--store", "archive").out
    assert_one_line(threadpitch("store", "list", "--store", kept.parent).err, "is a folder")


def test_the_trace_is_the_log(kept: Path) -> None:
    (first, *_) = read_groups(LOG, ColumnChoice())
    with open_store(str(kept)) as store:
        trace = store.run(1).trace
    assert trace is not None
    table = pyarrow.parquet.read_table(trace)
    rows = np.array([group.as_py() == first.name for group in table["group"]])
    np.testing.assert_array_equal(table["angle"].to_numpy()[rows], first.angle)
    np.testing.assert_array_equal(table["position"].to_numpy()[rows], first.position)
    assert table.schema.field("angle").metadata == {b"unit": b"rad"}


def test_show_and_compare(kept: Path, threadpitch: Command) -> None:
    shown = threadpitch("store", "show", 2, "--store", "runs.db").out
    assert "Serial number: S-2" in shown
    assert "theta_S2" in shown
    assert "\x1b" not in shown
    compared = json.loads(threadpitch("store", "compare", 1, 2, "--store", "runs.db", "--json").out)["series"]
    assert [one["mean_less_first_um"] for one in compared if one["run"] == 2 and one["start_angle_deg"] == 0] == [0, 0]
    assert "Less first" in threadpitch("store", "compare", 1, 2, "--store", "runs.db").out
    assert_one_line(threadpitch("store", "compare", 1, "--store", "runs.db").err, "one run cannot be compared")


def test_export_reads_back(kept: Path, threadpitch: Command) -> None:
    for form in ("csv", "json", "parquet"):
        assert threadpitch("store", "export", 2, "--format", form, "--output", "out", "--store", "runs.db").status == 0
    assert {path.name for path in Path("out").iterdir()} == {"run-2-pitch.csv", "run-2.json", "run-2-pitch.parquet",
                                                             "run-2-trace.parquet"}
    document = json.loads(Path("out/run-2.json").read_text(encoding="utf-8"))
    with Path("out/run-2-pitch.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    pitches = [value for one in document["passes"] for row in one["pitch_mm"] for value in row if value is not None]
    assert [float(row["pitch_mm"]) for row in rows] == pitches
    assert float(rows[0]["deviation_um"]) == pytest.approx(1e3 * (pitches[0] - 3.0))
    table = pyarrow.parquet.read_table("out/run-2-pitch.parquet")
    assert table["pitch_mm"].to_pylist() == pitches
    assert table.schema.field("pitch_mm").metadata == {b"unit": b"mm"}
    assert json.loads(table.schema.metadata[b"threadpitch"])["serial_number"] == "S-2"
    assert_one_line(threadpitch("store", "export", 2, "--format", "qif", "--store", "runs.db").err,
                    "format 'qif' is not known; choose csv, json or parquet")


def test_note_delete_verify(kept: Path, threadpitch: Command) -> None:
    assert threadpitch("store", "note", 1, "remeasured", "--store", "runs.db").status == 0
    assert threadpitch("store", "delete", 2, "--store", "runs.db").status == 0
    whole = threadpitch("store", "verify", "--store", "runs.db")
    assert (whole.status, whole.out.splitlines()[-1][:16]) == (0, "1 runs in " + str(kept)[:6])
    with open_store(str(kept)) as store:
        assert store.run(1).summary.note == "remeasured"
        trace = store.run(1).trace
    assert trace is not None
    trace.unlink()
    (trace.parent / f"{'0' * 64}.parquet").touch()
    broken = threadpitch("store", "verify", "--clean", "--json", "--store", "runs.db")
    assert broken.status == 2
    document = json.loads(broken.out)
    assert (document["removed"], [one["kind"] for one in document["findings"]]) == (1, ["missing"])
    for number in (2, 2**63):
        for command in (("show", number), ("note", number, "x"), ("delete", number)):
            done = threadpitch("store", *command, "--store", "runs.db")
            assert_one_line(done.err, f"run {number} is not in the store")


def test_a_simulation_and_measured_pitches_are_kept(workplace: Path, threadpitch: Command) -> None:
    ran = threadpitch("run", "--start-angle", "0", "--store", "runs.db", "--json")
    stored = json.loads(ran.out)["stored"]
    (workplace / "measured.csv").write_text("turn,pitch_mm\n" + "".join(f"{n},3.0{n % 3}\n" for n in range(3, 13)))
    judged = threadpitch("analyze", LOG, "--store", "runs.db", "--measured", "measured.csv", "--target", "3",
                         "--uncertainty", "1", "--json")
    assert judged.status == 0, judged.err
    with open_store("runs.db") as store:
        simulated, measured = store.run(stored["run"]), store.run(2)
        events = store.events(limit=10_000)
    assert {one.calculator for one in simulated.passes} == {"nominal_pitch", "actual_pitch"}
    assert simulated.summary.series[0].effective is not None
    assert simulated.passes[0].target == 1.5e-3
    assert simulated.summary.cause == json.loads(ran.out)["verdict"]["cause"]
    assert simulated.provenance["components"]["spindle"]["sha256"]
    assert simulated.trace is not None
    assert "nominal_pitch.pitch[1]" in pyarrow.parquet.read_schema(simulated.trace).names
    assert measured.passes[-1].calculator == "measured"
    assert np.isnan(measured.passes[-1].table.pitch[0, :2]).all()
    assert measured.passes[-1].table.pitch[0, 2] == pytest.approx(3.0e-3)
    assert measured.verdict is not None
    assert measured.summary.cause == json.loads(judged.out)["verdict"]["cause"]
    kinds = [one.kind for one in events if one.run == simulated.summary.uid]
    assert (kinds[0], kinds[-1], set(kinds[1:-1])) == ("begin", "result", {"revolution"})
    turns = sum(int(np.sum(~np.isnan(one.table.pitch))) for one in simulated.passes)
    assert kinds.count("revolution") == turns


def test_a_resumed_simulation_is_kept_whole(workplace: Path, threadpitch: Command) -> None:
    """As the run that never ended: its passes, its verdict, and its revolutions, those before the checkpoint too."""
    run, kept = ("run", "--start-angle", "0"), ("--machine", "Lathe 3", "--thread", "M20x1.5", "--store", "runs.db")
    assert threadpitch(*run, *kept, "--stop-time", "1.2").status == 0
    assert threadpitch(*run, "--stop-time", "0.7", "--checkpoint", "state").status == 0
    resumed = threadpitch("resume", "state", "--stop-time", "1.2", *kept, "--json")
    assert (resumed.status, resumed.err) == (0, "")
    assert json.loads(resumed.out)["stored"]["run"] == 2
    with open_store("runs.db") as store:
        runs, events = [store.run(number) for number in (1, 2)], store.events(limit=10_000)
    told = [[one.document for one in events if one.run == run.summary.uid and one.kind == "revolution"]
            for run in runs]
    key = operator.itemgetter("calculator", "turn")
    assert sorted(told[0], key=key) == sorted(told[1], key=key)
    assert len(told[0]) == sum(int(np.sum(~np.isnan(one.table.pitch))) for one in runs[0].passes)
    assert [one.summary.machine for one in runs] == ["Lathe 3"] * 2
    assert runs[0].verdict == runs[1].verdict
    assert runs[0].verdict is not None
    refused = threadpitch("resume", "state", "--machine", "Lathe 3")
    assert refused.status == 2
    assert_one_line(refused.err, "--machine is kept with a run; give --store or --publish too")
    for first, second in zip(runs[0].passes, runs[1].passes, strict=True):
        np.testing.assert_array_equal(first.table.pitch, second.table.pitch)


def test_watched_revolutions_are_events_and_a_run(workplace: Path, threadpitch: Command) -> None:
    Path("log.csv").write_bytes(gzip.decompress((LOGS / "A_ideal_500.csv.gz").read_bytes()))
    done = threadpitch("watch", "log.csv", "--idle", "0.1", "--store", "runs.db", "--json")
    lines = [json.loads(line) for line in done.out.splitlines()]
    with open_store("runs.db") as store:
        (run,) = store.runs()
        events = [one.document for one in store.events(run=run.uid, limit=10_000) if one.kind == "revolution"]
    assert [one["pitch_mm"] for one in events] == [line["pitch_mm"] for line in lines]
    assert [one["mean_mm"] for one in events] == [line["mean_mm"] for line in lines]


def test_a_store_that_cannot_be_opened_ends_it_before_anything_is_computed(workplace: Path,
                                                                           threadpitch: Command) -> None:
    (workplace / "runs.db").write_bytes(b"x" * 4096)
    for command in (("run",), ("analyze", LOG), ("run", "--program", LOGS / "g33_500.ngc"), ("store", "list")):
        done = threadpitch(*command, "--store", "runs.db")
        assert done.status == 2
        assert_one_line(done.err, "it is damaged or no store")
    assert not (workplace / "threadpitch-run").exists()


def test_a_store_that_is_not_there_is_not_made_by_looking(threadpitch: Command, workplace: Path) -> None:
    for words in (("list",), ("show", "1"), ("verify",), ("export", "1", "--output", "out")):
        outcome = threadpitch("store", *words, "--store", "nosuch.db")
        assert outcome.status == 2
        assert "nosuch.db: is not there, so it holds no runs" in outcome.err
    assert not list(workplace.glob("nosuch*"))


def test_the_start_of_the_feed_is_not_in_the_figures_of_a_log(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("analyze", LOGS / "A_ideal_500.csv.gz", "--store", "runs.db")
    assert done.status == 0
    found = json.loads(threadpitch("store", "list", "--store", "runs.db", "--json").out)
    of_all, of_thread = (figures := found["runs"][0]["statistics"][0]), figures["effective"]
    assert of_all["turns"] > of_thread["turns"] > 0.8 * of_all["turns"]
    assert of_thread["mean_mm"] == pytest.approx(1.5, abs=1e-4)
    assert of_thread["standard_deviation_um"] < 1.0 < of_all["standard_deviation_um"]


def test_what_a_measuring_plan_found_is_kept(threadpitch: Command, workplace: Path) -> None:
    done = threadpitch("run", "--stop-time", "1.6", "--measure", "uncertainty=1um", "seed=1", "--store", "runs.db")
    assert done.status == 0, done.err
    with open_store("runs.db") as store:
        run = store.run(1)
    measured = [one for one in run.passes if one.calculator == "measured"]
    assert {one.label for one in measured} == {"negative_z", "positive_z"}
    assert all(np.nanmax(np.abs(one.table.pitch - 1.5e-3)) < 20e-6 for one in measured)
    assert run.summary.main_series is not None
    assert run.summary.main_series.calculator == "measured"
    assert run.summary.cause is not None
