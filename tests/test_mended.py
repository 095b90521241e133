"""Outliers, latency and the lead of synchronous motion, piece by piece: the same bits as of the whole recording."""

import math
import os
import threading
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_passes_found import cycle
from tests.test_signals import REVS, TIME, Z, write
from threadpitch.pitch import GroupPitch, StreamedPitch, pitch_tables, stream_pitches
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, TraceError, array_files, text_rows
from threadpitch.trace.choice import Chosen
from threadpitch.trace.conditioned import Samples, joined
from threadpitch.trace.groups import Group
from threadpitch.trace.mended import mended

CHOSEN = Chosen(0, 1, None, 2, "rev", "m", "s", None)


def in_pieces(signals: Signals, borders: list[float], time: FloatArray, position: FloatArray) -> tuple[Samples, Group]:
    """(what comes out of a recording that is cut at these shares of its length, the group)."""
    group = Group("1", "log", CHOSEN, signals)
    cuts = [0, *sorted(round(border * time.size) for border in borders), time.size]
    angle = np.arange(time.size) / 100.0
    parts = [(group, Samples(angle[a:b], TURN, position[a:b], 1.0, time[a:b])) for a, b in pairwise(cuts)]
    return joined([samples for _, samples in mended(parts)]), group


def plain_outliers(position: FloatArray, limit: float) -> FloatArray:
    """Samples farther from the middle of their neighbours than the limit, and than these from theirs, put there."""
    inner = range(1, position.size - 1)
    off = [0.0, *(abs(position[i] - 0.5 * (position[i - 1] + position[i + 1])) for i in inner), 0.0]
    found = position.copy()
    for i in inner:
        if off[i] > limit and off[i] >= max(off[i - 1], off[i + 1]):
            found[i] = 0.5 * (position[i - 1] + position[i + 1])
    return found


@settings(deadline=None, max_examples=100)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(2, 300), share=st.floats(0.0, 0.5),
       borders=st.lists(st.floats(0.0, 1.0), max_size=12))
def test_outliers_of_pieces_are_those_of_the_whole(seed: int, size: int, share: float, borders: list[float]) -> None:
    random = np.random.default_rng(seed)
    position = 1e-5 * np.arange(size) + 1e-3 * (random.random(size) < share) * random.uniform(-1.0, 1.0, size)
    found, group = in_pieces(Signals(outlier=1e-4), borders, 1e-3 * np.arange(0.0, size), position)
    expected = plain_outliers(position, 1e-4)
    np.testing.assert_array_equal(found.position, expected)
    np.testing.assert_array_equal(found.angle, np.arange(size) / 100.0 * TURN)
    changed = np.count_nonzero(expected != position)
    assert any(note.startswith(f"{changed} positions stuck out") for note in group.all_notes()) == (changed > 0)


@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(3, 300), latency=st.floats(-0.2, 0.2),
       borders=st.lists(st.floats(0.0, 1.0), max_size=12))
def test_a_latency_of_pieces_is_that_of_the_whole(seed: int, size: int, latency: float, borders: list[float]) -> None:
    random = np.random.default_rng(seed)
    time = np.cumsum(random.uniform(0.0, 2e-3, size) * (random.random(size) < 0.9))  # some instants come twice
    position = random.normal(0.0, 1e-3, size)
    there = (time + latency >= time[0]) & (time + latency <= time[-1])
    if latency == 0.0:
        return
    if np.count_nonzero(there) < 2:
        with pytest.raises(TraceError, match="is longer than the recording"):
            in_pieces(Signals(latency=latency), borders, time, position)
        return
    found, group = in_pieces(Signals(latency=latency), borders, time, position)
    np.testing.assert_array_equal(found.position, np.interp(time + latency, time, position)[there])
    np.testing.assert_array_equal(found.time, time[there])
    np.testing.assert_array_equal(found.angle, (np.arange(size) / 100.0 * TURN)[there])
    assert any("later than recorded" in note for note in group.all_notes())


def test_what_is_held_for_a_latency_does_not_grow() -> None:
    """A million samples in pieces of a thousand, 5 ms of which are waited for."""
    group = Group("1", "log", CHOSEN, Signals(latency=0.005, outlier=1.0))
    most = 0

    def pieces() -> Iterator[tuple[Group, Samples]]:
        for first in range(0, 1_000_000, 1000):
            numbers = np.arange(first, first + 1000.0)
            yield group, Samples(numbers, 1.0, numbers, 1.0, 1e-3 * numbers)

    for _, samples in mended(pieces()):
        most = max(most, samples.size)
    assert most <= 1010


def equal(one: Sequence[StreamedPitch], other: Sequence[GroupPitch]) -> None:
    assert [group.label for group in one] == [group.label for group in other]
    for streamed, whole in zip(one, other, strict=True):
        np.testing.assert_array_equal(streamed.table.pitch, whole.table.pitch)
        assert streamed.table.notes == whole.table.notes


@pytest.mark.parametrize("signals", [
    Signals(outlier=2e-5), Signals(latency=0.0042), Signals(latency=-0.0042), Signals(latency=0.0042, outlier=2e-5),
    Signals(latency=0.0042, outlier=2e-5, synchronous=True),
])
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_streamed_logs_are_mended_as_whole_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, signals: Signals,
                                                kind: str) -> None:
    spoiled = Z.copy()
    spoiled[[500, 1250, 1751]] += (3.0, -0.2, 0.05)
    path = write(tmp_path / "log.csv", time_s=TIME, revs=-REVS, z_mm=spoiled)
    if kind == "parquet":
        csv, parquet = pytest.importorskip("pyarrow.csv"), pytest.importorskip("pyarrow.parquet")
        parquet.write_table(csv.read_csv(path), tmp_path / "log.parquet")
        path = tmp_path / "log.parquet"
    whole = pitch_tables(path, ColumnChoice(), (0.0, 1.0), signals)
    monkeypatch.setattr(text_rows, "BLOCK", 700)
    monkeypatch.setattr(array_files, "CHUNK", 37)
    equal(stream_pitches(path, ColumnChoice(), (0.0, 1.0), signals), whole)


def test_the_lead_of_synchronous_motion_is_found_in_a_first_reading(tmp_path: Path) -> None:
    path = write(tmp_path / "cycle.csv", **cycle())
    signals = Signals(synchronous=True)
    whole = pitch_tables(path, ColumnChoice(), (0.0,), signals)
    assert len(whole) > 1
    equal(stream_pitches(path, ColumnChoice(), (0.0,), signals), whole)
    os.mkfifo(tmp_path / "pipe")  # what can be read once only
    writer = threading.Thread(target=lambda: (tmp_path / "pipe").write_bytes(path.read_bytes()))
    writer.start()
    equal(stream_pitches(tmp_path / "pipe", ColumnChoice(), (0.0,), signals), whole)
    writer.join()


@pytest.mark.parametrize(("column", "sample", "value", "text"), [
    ("time_s", 1500, 0.0, r"log.csv:1502: time runs back from 1.499 to 0 s"),
    ("time_s", 700, math.inf, r"log.csv:702: time is not finite"),
    ("z_mm", 700, math.nan, r"log.csv:702: position is NaN"),
    ("z_mm", 700, math.inf, r"log.csv:702: position is inf"),
])
@pytest.mark.parametrize("latency", [-0.004, 0.004])
def test_damage_is_named_where_it_stands(tmp_path: Path, column: str, sample: int, value: float, text: str,
                                         latency: float) -> None:
    columns = {"time_s": TIME.copy(), "revs": REVS, "z_mm": Z.copy()}
    columns[column][sample] = value
    path = write(tmp_path / "log.csv", **columns)
    for signals in (Signals(latency=latency), Signals(latency=latency, outlier=1e-4)):
        with pytest.raises(TraceError, match=text):
            stream_pitches(path, ColumnChoice(), (0.0,), signals)
        with pytest.raises(TraceError, match=text):
            pitch_tables(path, ColumnChoice(), (0.0,), signals)
