"""What goes into the store comes out of it, bit for bit, in SQLite and in PostgreSQL."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from threadpitch.pitch import PitchTable
from threadpitch.store import NewEvent, NewRun, RunFilter, Store, StoredPass, StoreError, open_store
from threadpitch.store.trace_folder import ABANDONED

MakeRun = Callable[..., NewRun]
HOSTILE = [
    "'; DROP TABLE runs; --", "../../etc/passwd", "\x1b]0;owned\x07", "<script>alert(1)</script>", "%_\\", "\u202e",
           "a\x00b", os.fsdecode(b"\xff.csv")]


def test_a_run_comes_back_as_it_was(store: Store, make_run: MakeRun) -> None:
    given_run = make_run()
    number = store.add(given_run)
    found = store.run(number)
    (one,), (expected,) = found.passes, given_run.passes
    np.testing.assert_array_equal(one.table.pitch, expected.table.pitch)
    np.testing.assert_array_equal(one.in_metal, expected.in_metal & ~np.isnan(expected.table.pitch))
    np.testing.assert_array_equal(one.table.start_angles, expected.table.start_angles)
    assert (one.calculator, one.label, one.target, one.told) == ("nominal_pitch", "1", 1.5e-3, dict(expected.told))
    assert found.verdict == given_run.verdict
    assert found.provenance == given_run.provenance
    assert found.trace is not None
    assert found.trace.read_bytes() == b"a trace"
    assert abs(found.summary.recorded_at - datetime.now(UTC)) < timedelta(minutes=1)


def test_statistics_are_kept_beside_the_pitches(store: Store, make_run: MakeRun) -> None:
    run = make_run()
    store.add(run)
    first, second = store.runs()[0].series
    pitch = run.passes[0].table.pitch
    assert (first.turns, second.turns) == (12, 11)
    assert (first.minimum, first.maximum) == (pitch[0].min(), pitch[0].max())
    assert first.standard_deviation == pytest.approx(float(np.std(pitch[0], ddof=1)), rel=1e-12)
    assert first.effective is not None
    assert first.effective.turns == 9
    assert first.best.mean == pytest.approx(float(pitch[0, 3:].mean()), rel=1e-15)


def test_a_pass_without_turns_has_no_statistics(store: Store, make_run: MakeRun) -> None:
    table = PitchTable.of_pitches(np.full((1, 3), np.nan), [0.0])
    number = store.add(make_run(passes=(StoredPass("log", "1", table),)))
    (series,) = store.runs()[0].series
    assert series.turns == 0
    assert math.isnan(series.mean)
    assert store.run(number).passes[0].table.pitch.shape == (1, 3)


def test_the_same_run_twice_is_one(store: Store, make_run: MakeRun) -> None:
    run = make_run()
    assert store.add(run) == store.add(run)
    assert store.count() == 1


def test_filters(store: Store, make_run: MakeRun) -> None:
    numbers = [store.add(make_run(machine=f"Lathe {n}", serial_number=f"S-{n}", note="100 % done", verdict=None))
               for n in range(3)]
    assert [run.number for run in store.runs()] == numbers[::-1]
    assert [run.number for run in store.runs(RunFilter(machine="Lathe 1"))] == [numbers[1]]
    assert store.count(RunFilter(text="lathe 2")) == 1
    assert store.count(RunFilter(text="100 %")) == 3
    assert store.count(RunFilter(text="100 _")) == 0  # wildcards of SQL are letters
    assert store.count(RunFilter(since=datetime.now(UTC) + timedelta(hours=1))) == 0
    assert store.count(RunFilter(until=datetime.now(UTC) + timedelta(hours=1), cause="control")) == 0
    assert [run.number for run in store.runs(RunFilter(limit=1, offset=1))] == [numbers[1]]
    assert store.choices()["machine"] == ["Lathe 0", "Lathe 1", "Lathe 2"]


def test_a_note_can_be_changed(store: Store, make_run: MakeRun) -> None:
    number = store.add(make_run())
    store.set_note(number, "measured again")
    assert store.run(number).summary.note == "measured again"
    with pytest.raises(StoreError, match="run 99 is not in the store"):
        store.set_note(99, "")


def test_hostile_names_are_text(store: Store, make_run: MakeRun) -> None:
    for text in HOSTILE:
        number = store.add(make_run(machine=text, source=text, serial_number=text, note=text))
        kept = store.run(number).summary.machine
        assert kept == text.replace("\0", "\ufffd").encode("utf-8", "replace").decode()
        assert [run.number for run in store.runs(RunFilter(machine=text))] == [number]
        assert number in [run.number for run in store.runs(RunFilter(text=text))]
    files = [path for path in store.traces.path.rglob("*") if path.is_file()]
    assert [path.relative_to(store.traces.path).parts[1:] for path in files] == [
        (f"{store.run(number).summary.trace_sha256}.parquet",)]


def test_equal_traces_are_one_file_until_the_last_run_is_deleted(store: Store, make_run: MakeRun) -> None:
    first, second = store.add(make_run()), store.add(make_run())
    trace = store.run(second).trace
    assert trace is not None
    store.delete([first])
    assert trace.exists()
    store.delete([second])
    assert not trace.exists()
    assert store.verify() == []


def test_delete_is_all_or_nothing(store: Store, make_run: MakeRun) -> None:
    number = store.add(make_run())
    with pytest.raises(StoreError, match="run 99 is not in the store"):
        store.delete([number, 99])
    assert store.count() == 1


def test_numbers_are_not_given_again(store: Store, make_run: MakeRun) -> None:
    first = store.add(make_run())
    store.delete([first])
    assert store.add(make_run()) > first


def test_verify_finds_what_is_damaged_missing_or_left(store: Store, make_run: MakeRun, tmp_path: Path) -> None:
    numbers = []
    for content in (b"damaged", b"missing"):
        (tmp_path / "other").write_bytes(content)
        numbers.append(store.add(make_run(trace=tmp_path / "other")))
    damaged, missing = (store.run(number).trace for number in numbers)
    assert damaged is not None
    assert missing is not None
    damaged.write_bytes(b"DAMAGED")
    missing.unlink()
    orphan = store.traces.file("ab" * 32)
    orphan.parent.mkdir()
    orphan.touch()
    dead = store.traces.path / "unfinished" / "dead.parquet"
    dead.touch()
    os.utime(dead, (time.time() - 2.0 * ABANDONED,) * 2)
    (store.traces.path / "unfinished" / "alive.parquet").touch()
    found = {(one.kind, one.what.partition(":")[0]) for one in store.verify()}
    assert found == {("damaged", str(damaged)), ("missing", str(missing)), ("leftover", str(orphan)),
                     ("leftover", str(dead))}
    assert store.remove_leftovers() == 2
    assert [one.kind for one in store.verify()] in (["damaged", "missing"], ["missing", "damaged"])


def test_events_have_one_order_without_gaps(store: Store) -> None:
    """Four writers at once."""
    def write(writer: int) -> None:
        for n in range(25):
            store.append([NewEvent("revolution", {"writer": writer, "n": n})])

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(write, range(4)))
    events = store.events(limit=1000)
    assert [one.sequence for one in events] == list(range(1, 101))
    for writer in range(4):
        assert [one.document["n"] for one in events if one.document["writer"] == writer] == list(range(25))


def test_an_event_that_is_appended_twice_is_there_once(store: Store) -> None:
    event = NewEvent("begin", {"infinite": math.inf}, run="r")
    assert (store.append([event]), store.append([event, NewEvent("begin", {})])) == (1, 2)
    assert store.events()[0].document == {"infinite": None}
    assert [one.sequence for one in store.events(run="r")] == [1]


def test_a_receiver_takes_what_comes_after_it(store: Store) -> None:
    store.append([NewEvent("begin", {})])
    assert store.register("new") == 1
    assert store.register("all", after=0) == 0
    store.append([NewEvent("begin", {}), NewEvent("begin", {})])
    store.acknowledge("new", 3)
    store.acknowledge("new", 2)  # late: nothing is taken back
    assert (store.taken("new"), store.taken("all")) == (3, 0)
    later = datetime.now(UTC) + timedelta(hours=1)
    assert store.forget(later) == 0  # "all" has taken nothing
    store.acknowledge("all", 2)
    assert store.forget(later) == 2
    assert [one.sequence for one in store.events()] == [3]
    store.acknowledge("all", 3)
    assert store.forget(later) == 0  # the newest stays, that sequences go on
    assert store.append([NewEvent("begin", {})]) == 4


def test_a_run_that_does_not_fit_together_is_refused(store: Store, make_run: MakeRun) -> None:
    run = make_run()
    wrong = replace(run.passes[0], in_metal=np.ones((1, 1), dtype=np.bool_))
    for bad, message in ((make_run(kind="x"), "of kind 'x' is not known"), (make_run(passes=(wrong,)), "in_metal is"),
                         (make_run(trace=Path("/nowhere/trace")), "cannot be stored")):
        with pytest.raises(StoreError, match=message):
            store.add(bad)
    assert store.count() == 0


@settings(deadline=None, max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.lists(st.floats(-1e3, 1e3) | st.just(math.nan), min_size=3, max_size=3), min_size=1, max_size=3),
       st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20))
def test_any_pitches_and_names_come_back(tmp_path_factory: pytest.TempPathFactory, rows: list[list[float]],
                                         name: str) -> None:
    pitch = np.array(rows)
    table = PitchTable.of_pitches(pitch, np.arange(len(rows)))
    with open_store(str(tmp_path_factory.mktemp("any") / "runs.db")) as store:
        number = store.add(NewRun(kind="log", source=name, passes=(StoredPass(name, name, table),)))
        found = store.run(number)
        np.testing.assert_array_equal(found.passes[0].table.pitch, pitch)
        assert (found.passes[0].label, found.summary.source) == (name, name)
