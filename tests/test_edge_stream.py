"""Crossings by edges of a stream are those of the whole recording, bit for bit, however it is cut."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.test_pitch_stream import STARTS, shaken, tables
from tests.test_signals import COUNTS, TIME, Z, write
from threadpitch.pitch import PitchTable, edge_pitch_table, pitch_tables, stream_pitches
from threadpitch.pitch.edge_stream import EdgeStream
from threadpitch.pitch.edges import MOST
from threadpitch.pitch.recorded import pitch_table
from threadpitch.pitch.rounding import LOOKED_AT
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, Trace, array_files, text_rows


def in_pieces(trace: Trace, cuts: list[int], starts: tuple[float, ...]) -> PitchTable:
    linear = pitch_table(trace, starts)
    edges = EdgeStream(linear.start_angles, linear.turns_before, trace.resolution, trace.whole())
    for first, last in pairwise([0, *cuts, trace.angle.size]):
        edges.add(trace.angle[first:last], trace.position[first:last])
    return edges.table(linear)


def assert_equal(one: PitchTable, other: PitchTable) -> None:
    assert one.uncertainty is not None
    assert other.uncertainty is not None
    np.testing.assert_array_equal(one.crossings, other.crossings)
    np.testing.assert_array_equal(one.pitch, other.pitch)
    np.testing.assert_array_equal(one.uncertainty, other.uncertainty)
    assert one.notes == other.notes


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(3000, 30_000), known=st.booleans(),
       borders=st.lists(st.floats(0.0, 1.0), max_size=12))
def test_pieces_give_the_bits_of_the_whole(seed: int, size: int, known: bool, borders: list[float]) -> None:
    angle, position = shaken(seed, size)
    trace = Trace(angle, position, resolution=TURN / 100.0 if known else 0.0, name="1")
    cuts = sorted(round(border * size) for border in borders)
    both = tables(lambda: in_pieces(trace, cuts, STARTS), lambda: edge_pitch_table(trace, STARTS))
    if both is not None:
        assert_equal(*both)


def test_what_is_kept_does_not_grow() -> None:
    """The spindle stands for most of a million samples, just behind a crossing."""
    numbers = np.arange(1_000_000.0)
    angle: FloatArray = np.where(numbers < 30_000.0, numbers, 30_000.0 + np.maximum(numbers - 900_000.0, 0.0)) * 1e-3
    position = 1e-3 * angle
    trace = Trace(angle, position)
    linear = pitch_table(trace, (0.0, 30.0))
    edges = EdgeStream(linear.start_angles, linear.turns_before, 0.0, "log")
    most = 0
    for first in range(0, angle.size, 5000):
        edges.add(angle[first : first + 5000], position[first : first + 5000])
        most = max(most, edges._window.angle.size)
    assert most <= max(LOOKED_AT, 2 * MOST) + 5000
    assert_equal(edges.table(linear), edge_pitch_table(trace, (0.0, 30.0)))


@pytest.mark.parametrize("signals", [Signals(), Signals(latency=0.002, outlier=1e-3)])
def test_streamed_logs_have_the_tables_of_whole_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                     signals: Signals) -> None:
    csv, parquet = pytest.importorskip("pyarrow.csv"), pytest.importorskip("pyarrow.parquet")
    path = write(tmp_path / "log.csv", time_s=TIME, counts=COUNTS, z_mm=np.round(Z, 4))
    parquet.write_table(csv.read_csv(path), tmp_path / "log.parquet")
    choice = ColumnChoice("counts", "z_mm", "count", counts_per_turn=4096.0)
    (whole,) = pitch_tables(path, choice, (0.0, 1.0), signals, edge_pitch_table)
    monkeypatch.setattr(text_rows, "BLOCK", 700)
    monkeypatch.setattr(array_files, "CHUNK", 37)
    for log in (path, tmp_path / "log.parquet"):
        (group,) = stream_pitches(log, choice, (0.0, 1.0), signals, edges=True)
        assert_equal(group.table, whole.table)


def test_counts_that_are_told_help_an_angle_in_degrees(tmp_path: Path) -> None:
    """One count in every sample cannot be seen; the spindle is off by up to one that nobody knows."""
    samples = np.arange(3600.0)
    turns = (samples * (1.0 + 1e-4) + 0.3) / 1000.0
    path = write(tmp_path / "log.csv", spindle_deg=np.floor(1000.0 * turns) * 0.36, z_mm=1.5 * turns)
    unknown, known = (stream_pitches(path, ColumnChoice(counts_per_turn=counts), edges=True)[0].table.uncertainty
                      for counts in (None, 1000.0))
    assert unknown is not None
    assert known is not None
    one_count = 1.5e-3 / 1000.0
    assert unknown.max() < 0.01 * one_count
    assert 0.1 * one_count < known.min() < one_count
