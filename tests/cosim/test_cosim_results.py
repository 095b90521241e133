"""Results in files have the bits of those in memory, grow while the run computes, and say how they were made."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

from tests.cosim.slaves import variable
from threadpitch.cosim import CosimError, Method, Result, StepError, Watch, again, prepare, recording, resume, simulate
from threadpitch.cosim.block import Block, Channel, Channels
from threadpitch.cosim.parquet import read_metadata
from threadpitch.cosim.recording import MemoryRows, Taking
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]
OPTIONS: dict[str, Any] = {"parameters": {"a.start_x": 1.0}, "stop_time": 1.0, "step_size": 0.001}
KINDS = ["rows.parquet", "rows.csv", "rows.mat"]


@pytest.fixture
def system(probe_fmu: Path, probe3_fmu: Path) -> System:
    return System("two", (Component("a", probe_fmu), Component("b", probe3_fmu)),
                  (Connection("a", "x", "b", "u"), Connection("b", "x", "a", "u", convert_units=False)))


def same(one: Result, other: Result) -> None:
    assert list(one) == list(other)
    assert one.time.tobytes() == other.time.tobytes()
    for name in one:
        assert one[name].dtype == other[name].dtype
        assert one[name].tobytes() == other[name].tobytes(), name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_files_hold_the_bits_of_the_memory(system: System, tmp_path: Path, kind: str, engine: str,
                                           monkeypatch: pytest.MonkeyPatch) -> None:
    if kind.endswith("parquet"):
        pytest.importorskip("pyarrow")
    whole = simulate(system, record=["*"], **OPTIONS)
    monkeypatch.setattr(recording, "FILE_ROWS", 37)  # many blocks, the last one not full
    found = simulate(system, record=["*"], results=tmp_path / "new" / kind, engine=engine, **OPTIONS)
    assert (found.rows, found.completed, found.path) == (1001, True, tmp_path / "new" / kind)
    same(whole, found)
    simulate(system, record=["*"], results=tmp_path / "new" / kind, **{**OPTIONS, "stop_time": 0.1})
    assert len(list((tmp_path / "new").rglob("part-*"))) == (3 if kind.endswith("parquet") else 0)


def test_parquet_is_one_table_with_units_and_metadata(system: System, tmp_path: Path,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    monkeypatch.setattr(recording, "FILE_ROWS", 100)
    result = simulate(system, results=tmp_path / "r.parquet", **OPTIONS)
    table = parquet.read_table(tmp_path / "r.parquet")
    assert table.column_names == ["time", *result]
    assert table.num_rows == 1001
    assert table.schema.field("time").metadata == {b"unit": b"s"}
    assert table.schema.field("a.x").metadata == {b"unit": b"m"}
    assert str(table.schema.field("a.flag_out").type) == "bool"
    for part in (tmp_path / "r.parquet").iterdir():
        assert json.loads(parquet.read_schema(part).metadata[b"threadpitch"]) == result.metadata
    assert read_metadata(tmp_path / "r.parquet") == result.metadata
    (tmp_path / "empty").mkdir()
    with pytest.raises(CosimError, match="holds no results of threadpitch"):
        read_metadata(tmp_path / "empty")


def test_csv_has_its_metadata_beside_it(system: System, tmp_path: Path) -> None:
    result = simulate(system, results=tmp_path / "rows.csv", **OPTIONS)
    assert json.loads((tmp_path / "rows.csv.json").read_text()) == result.metadata
    assert (tmp_path / "rows.csv").read_bytes() == simulate(system, **OPTIONS).save(tmp_path).read_bytes()
    with (tmp_path / "rows.csv").open(newline="") as file:
        assert next(csv.reader(file))[:2] == ["time [s]", "a.x [m]"]


def words(matrix: np.ndarray[Any, Any]) -> list[str]:
    return ["".join(column).rstrip() for column in np.array(matrix).T]


def test_mat_has_the_layout_of_dymola(system: System, tmp_path: Path) -> None:
    """A trajectory in the transposed form: names in columns; dataInfo says which row of data_1 or data_2 it is."""
    result = simulate(system, results=tmp_path / "rows.mat", **OPTIONS)
    found = loadmat(tmp_path / "rows.mat", chars_as_strings=False)
    assert words(found["Aclass"].T) == ["Atrajectory", "1.1", "", "binTrans"]
    names, places = words(found["name"]), found["dataInfo"]
    assert names == ["time", *result]
    assert places.shape == (4, len(names))
    assert found["data_2"][0].tobytes() == result.time.tobytes()
    assert found["data_1"][0].tolist() == [0.0, 1.0]
    for name, (matrix, row, _, _) in zip(names[1:], places.T[1:], strict=True):
        changing = np.unique(result[name]).size > 1
        assert matrix == (2 if changing else 1)
        values = found[f"data_{matrix}"][row - 1]
        assert np.array_equal(values, result[name] if changing else np.repeat(result[name][0], 2))
    descriptions = dict(zip(names, words(found["description"]), strict=True))
    assert descriptions["time"] == "Time in [s]"
    assert descriptions["a.x"] == "output [m]"
    assert descriptions["a.flag_out"] == "output (:#Boolean)"
    assert json.loads("".join(found["metadata"][0])) == result.metadata


def test_mat_is_read_by_dymat(system: System, tmp_path: Path) -> None:
    dymat = pytest.importorskip("DyMat", reason="a reader of Dymola's files, not needed otherwise")
    result = simulate(system, results=tmp_path / "rows.mat", **OPTIONS)
    found = dymat.DyMatFile(str(tmp_path / "rows.mat"))
    assert found.data("a.x").tobytes() == result["a.x"].tobytes()
    assert found.abscissa("a.x")[0].tobytes() == result.time.tobytes()
    assert set(found.names()) == set(result)


def test_metadata_say_how_a_result_was_made_and_make_it_again(system: System, probe_fmu: Path) -> None:
    method = Method("jacobi", extrapolation=1, multiples={"b": 2})
    result = simulate(system, method=method, record=["a.x", "b.*"], record_every=3, record_on=["b.x"],
                      about={"purpose": "test"}, engine="kernel", stop_time=0.6, step_size=0.01,
                      parameters={"a.k": np.float64(0.3), "a.label": "named", "a.gain": [1.0, "2mm"]})
    metadata = result.metadata
    assert metadata["method"]["multiples"] == {"b": 2}
    assert metadata["settings"]["a.gain[2]"] == 0.002
    assert metadata["about"] == {"purpose": "test"}
    assert (metadata["steps"], metadata["step_size"], metadata["engine"]) == (60, 0.01, "kernel")
    assert metadata["components"]["a"]["fmu"] == probe_fmu.name
    assert len(metadata["components"]["a"]["sha256"]) == 64
    repeated = simulate(system, **again(json.loads(json.dumps(metadata))))
    same(result, repeated)
    assert repeated.metadata == metadata
    with pytest.raises(CosimError, match="this is no metadata of a result: 'start_time'"):
        again({"steps": 3})


def test_a_plan_is_simulated_as_its_system_whatever_the_parameters(system: System) -> None:
    with prepare(system) as plan:
        for start in (1.0, 2.0):
            options = {**OPTIONS, "parameters": {"a.start_x": start}}
            found, expected = simulate(plan, **options), simulate(system, **options)
            same(found, expected)
            assert found.metadata == expected.metadata


def test_who_looks_on_at_a_resumed_run_sees_its_rows_from_the_beginning(system: System, tmp_path: Path) -> None:
    seen: list[float] = []
    watch = Watch(("b.x",), ("a.count",))  # it counts the steps
    simulate(system, watch=watch, checkpoint=tmp_path / "state", **{**OPTIONS, "stop_time": 0.4})
    result = resume(tmp_path / "state", system=system, stop_time=1.0, look=lambda rows: seen.extend(rows["b.x"]))
    assert result.watched is not None
    assert seen == result.watched["b.x"].tolist()
    assert len(seen) == 1001


def test_rows_on_events(system: System) -> None:
    whole = simulate(system, **OPTIONS)
    result = simulate(system, record=["b.x"], record_on=["a.count"], record_every=5, **OPTIONS)
    assert list(result) == ["b.x", "a.count"]
    assert result.time.tobytes() == whole.time[::5].tobytes()  # it counts the steps
    none = simulate(system, record=["b.x"], record_on=["a.flag_out"], **OPTIONS)
    assert none.time.tolist() == [0.0]
    assert none.completed


def test_what_is_watched_is_kept_besides(system: System, tmp_path: Path) -> None:
    """Every change is seen, however few rows are recorded."""
    whole = simulate(system, **OPTIONS)
    result = simulate(system, record=["b.x"], record_every=250, results=tmp_path / "rows.csv",
                      watch=Watch(("a.x",), ("a.count",)), **OPTIONS)
    assert result.time.tobytes() == whole.time[::250].tobytes()
    assert result["b.x"].tobytes() == whole["b.x"][::250].tobytes()
    assert list(result) == ["b.x"]
    watched = result.watched
    assert watched is not None
    assert list(watched) == ["a.x", "a.count"]
    assert watched["a.x"].tobytes() == whole["a.x"].tobytes()


@settings(deadline=None, max_examples=100, derandomize=True)
@given(values=st.lists(st.tuples(st.integers(0, 2), st.booleans()), min_size=1, max_size=60), every=st.integers(1, 4),
       cuts=st.lists(st.integers(1, 7), min_size=60, max_size=60))
def test_blocks_of_any_size_give_the_same_changes(values: list[tuple[int, bool]], every: int, cuts: list[int]) -> None:
    channels = Channels([Channel("c", variable("n", type_="Integer")), Channel("c", variable("f", type_="Boolean"))])
    taking = Taking(channels, MemoryRows(channels), every=every, on=["c.n", "c.f"])
    rows = np.array(values, np.int32)
    first = 0
    for cut in cuts:
        part = rows[first:first + cut]
        taking.take(Block.of_rows(channels, np.arange(first, first + len(part), dtype=np.float64),
                          {8: np.empty((len(part), 0), np.int64), 4: part, 2: np.empty((len(part), 0), np.int16),
                           1: np.empty((len(part), 0), np.int8)}), first)
        first += cut
    looked_at = range(0, len(values), every)
    wanted = [row for row in looked_at if row == 0 or values[row] != values[row - every]]
    assert taking.sink.close().times.tolist() == wanted
    assert taking.taken == len(wanted)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_recorded_before_a_fault_is_on_the_disk(system: System, tmp_path: Path, kind: str) -> None:
    with pytest.raises(StepError) as error:
        simulate(system, results=tmp_path / kind, **{
            **OPTIONS, "parameters": {"a.start_x": 1.0, "b.fault": 3, "b.fault_time": 0.5}})
    kept = error.value.result
    assert kept is not None
    assert (tmp_path / kind).exists()
    same(simulate(system, **{**OPTIONS, "stop_time": 0.5}), kept)


def test_what_cannot_be_written_is_told_before_the_run(system: System, tmp_path: Path) -> None:
    (tmp_path / "taken.parquet").write_text("mine")
    endless = {**OPTIONS, "stop_time": 1e9, "record_every": 10**6}
    with pytest.raises(CosimError, match=r"rows\.xlsx: results are written as \.parquet, \.csv, \.mat; choose a name"):
        simulate(system, results=tmp_path / "rows.xlsx", **endless)
    with pytest.raises(CosimError, match=r"taken\.parquet: is a file; Parquet is written as a folder"):
        simulate(system, results=tmp_path / "taken.parquet", **endless)
    with pytest.raises(OSError, match="taken"):
        simulate(system, results=tmp_path / "taken.parquet" / "rows.csv", **endless)
    assert (tmp_path / "taken.parquet").read_text() == "mine"


MEMORY = """
    import sys
    from pathlib import Path
    from threadpitch.cosim import simulate
    from threadpitch.cosim.system import Component, System
    system = System("one", (Component("a", Path({fmu!r})),))
    def peak():
        return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
    before = 0
    for steps in (200_000, {steps}):
        result = simulate(system, stop_time=float(steps), step_size=1.0, parameters={{"a.k": 0.0}}, engine="kernel",
                          results=Path({folder!r}, f"{{steps}}{kind}"))
        assert result.rows == steps + 1
        print(peak())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of the memory is read from /proc")
@pytest.mark.parametrize(("kind", "steps"), [(".parquet", 2_000_000), (".csv", 600_000)])
def test_more_steps_need_no_more_memory(probe_fmu: Path, tmp_path: Path, kind: str, steps: int) -> None:
    """Ten times the steps, which are 80 MB more in memory, raise the peak by less than 8 MB."""
    if kind == ".parquet":
        pytest.importorskip("pyarrow")
    program = textwrap.dedent(MEMORY.format(fmu=str(probe_fmu), folder=str(tmp_path), steps=steps, kind=kind))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])})
    assert done.returncode == 0, done.stderr
    short, long = map(int, done.stdout.split())  # KiB
    print(f"{kind}: {short / 1024:.1f} MiB after 200,000 steps, {long / 1024:.1f} MiB after {steps}")
    assert long - short < 8 * 1024
