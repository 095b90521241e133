"""Passes by the index enable, by synchronous motion and by a flag in a longer recording; levels A and B counted."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import GroupPitch, edge_pitch_table, pitch_tables, stream_pitches, thread_pitch
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, TraceError
from threadpitch.trace.quadrature import LevelError, Quadrature
from threadpitch.trace.synchronous import synchronous_passes

LOGS = Path(__file__).parent.parent / "models" / "logs" / "linuxcnc"
LEAD = 1.5  # mm
PASSES = 3
THREAD = 1500  # samples of a pass
TIME: FloatArray = 1e-3 * np.arange(14000.0)


def cycle() -> dict[str, FloatArray]:
    """A spindle that starts and then turns with ripple; three passes from rest, each with a rapid return."""
    speed = np.clip(TIME, 0.0, 1.0) * (9.0 + 0.4 * np.sin(3.0 * TIME))
    revs = np.cumsum(speed) * 1e-3
    position, enable = np.full(TIME.size, 5.0), np.zeros(TIME.size)
    for begin in (2500 + 3500 * number for number in range(PASSES)):
        begin = int(np.searchsorted(revs, math.ceil(revs[begin])))  # at the index
        end = begin + THREAD
        position[begin:end] = 5.0 - LEAD * (revs[begin:end] - revs[begin]) + 1e-3 * np.sin(3.0 * revs[begin:end])
        position[end : end + 300] = position[end - 1]
        position[end + 300 : end + 700] = np.linspace(position[end - 1], 5.0, 400)
        enable[begin - 200 : begin] = 1.0
    return {"time_s": TIME, "revs": revs, "z_mm": position, "index_enable": enable}


def write(path: Path, **columns: FloatArray) -> Path:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("how", ["synchronous", "lead", "index"])
def test_passes_of_a_machining_cycle_are_found(tmp_path: Path, how: str) -> None:
    columns = cycle()
    path = write(tmp_path / "cycle.csv", **columns)
    choice = ColumnChoice("revs", "z_mm", index_enable="index_enable" if how == "index" else None)
    signals = Signals(synchronous=how != "index", lead=1e-3 * LEAD if how == "lead" else None)
    groups = pitch_tables(path, choice, (0.0,), signals)
    assert [group.label for group in groups] == ["1", "2", "3"]
    for number, group in enumerate(groups):
        first = int(np.flatnonzero(np.diff(columns["z_mm"]) < 0.0)[0]) if number == 0 else None
        if first is not None:
            assert abs(group.trace.angle[0] / TURN - columns["revs"][first]) < 0.3
        known = group.table.pitch[0, ~np.isnan(group.table.pitch[0])]
        assert known.size >= 11
        np.testing.assert_allclose(known[1:], 1e-3 * LEAD, rtol=0.0, atol=3e-6)
        assert np.isnan(group.table.pitch[0]).sum() <= 1
        assert any("the feed moves 1.5 mm per turn" in note for note in group.table.notes)


def test_a_lead_that_is_nowhere_and_a_column_that_never_falls_are_refused(tmp_path: Path, threadpitch: Command) -> None:
    columns = cycle()
    path = write(tmp_path / "cycle.csv", **columns)
    assert_one_line(threadpitch("analyze", path, "--synchronous", "--target", "4").err,
                    "no synchronous motion of 4 mm per turn of the feed over 1.5 turns was found")
    assert_one_line(threadpitch("analyze", path, "--index-enable", "time_s").err, "never falls from 1 to 0")
    assert_one_line(threadpitch("analyze", path, "--index-enable", "index_enable", "--group", "time_s").err,
                    "by the index enable or by a group, not by both")
    still = write(tmp_path / "still.csv", revs=columns["revs"], z_mm=0.0 * TIME)
    assert_one_line(threadpitch("analyze", still, "--synchronous").err, "no synchronous motion of the feed")
    with pytest.raises(TraceError, match="needs the whole log in memory"):
        stream_pitches(path, ColumnChoice(), (0.0,), Signals(latency=math.nan))


def linuxcnc(name: str, choice: ColumnChoice, signals: Signals | None = None) -> list[GroupPitch]:
    return pitch_tables(LOGS / f"{name}.csv.gz", choice, (0.0,), signals)


@pytest.mark.parametrize("name", ["A_ideal_500", "H_droop_500", "J_twostart_400"])
def test_passes_by_index_enable_are_those_of_the_controller(name: str) -> None:
    """What the controller flagged, found again; LinuxCNC's index sets the turns to zero in every pass."""
    flagged = linuxcnc(name, ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass"))
    found = linuxcnc(name, ColumnChoice("spindle_revs_encoder", "z_fb_mm", index_enable="index_enable"))
    assert len(found) == len(flagged)
    for one, other in zip(found, flagged, strict=True):
        turns = min(one.table.pitch.shape[1], other.table.pitch.shape[1])
        assert turns >= other.table.pitch.shape[1] - 2  # the last turns brake: no longer synchronous
        np.testing.assert_allclose(one.table.pitch[:, 1:turns], other.table.pitch[:, 1:turns], rtol=0.0, atol=1e-12)


def test_synchronous_motion_is_told_from_positioning() -> None:
    angle = np.arange(0.0, 100.0 * TURN, 0.05)
    turns = angle / TURN
    position = np.interp(turns, [0.0, 20.0, 22.0, 60.0, 63.0, 100.0], [0.0, 0.0, -0.02, -0.058, 0.0, 0.0])
    (found,) = synchronous_passes(angle, position)
    assert abs(found.movement - -1e-3) < 1e-5
    assert abs(turns[found.last - 1] - 60.0) < 0.3
    (rapid,) = synchronous_passes(angle, position, lead=0.0193)
    assert abs(rapid.movement - 0.058 / 3.0) < 1e-4
    assert synchronous_passes(angle[:5], position[:5]) == []
    assert synchronous_passes(angle, np.full(angle.size, np.nan)) == []


def test_turns_of_a_flagged_pass_are_counted_from_its_beginning(tmp_path: Path) -> None:
    """n = 1 is the first whole turn of the pass, however long the spindle turned before."""
    revs = 10.0 * TIME[:9000]
    threading = (TIME[:9000] > 5.0) & (TIME[:9000] < 8.0)
    path = write(tmp_path / "flag.csv", revs=revs, z_mm=np.where(threading, LEAD * (revs - 50.0), 0.0),
                 threading=threading.astype(float))
    (one,) = pitch_tables(path, ColumnChoice())
    assert one.table.turns_before == 51
    np.testing.assert_allclose(one.table.pitch[0], 1e-3 * LEAD, rtol=0.0, atol=1e-12)
    (group,) = pitch_tables(path, ColumnChoice(), (0.0, 0.75 * TURN))
    assert group.table.turns_before == 50  # 270 degrees come before the first 0 degrees
    np.testing.assert_allclose(group.table.pitch[1], 1e-3 * LEAD, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(group.table.pitch[0, 1:], one.table.pitch[0])
    (streamed,) = stream_pitches(path, ColumnChoice(), (0.0, 0.75 * TURN))
    np.testing.assert_array_equal(streamed.table.pitch, group.table.pitch)
    (stored,) = stream_pitches(path, ColumnChoice(), (0.0,), interval=math.radians(10.0))
    assert stored.table.turns_before in (50, 51)
    np.testing.assert_allclose(stored.table.pitch[0], 1e-3 * LEAD, rtol=0.0, atol=1e-12)
    (edges,) = pitch_tables(path, ColumnChoice(), (0.0,), None, edge_pitch_table)
    assert edges.table.turns_before == 51


def levels(counts: FloatArray, per_turn: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levels A and B, and a pulse in count 5 of every turn."""
    phase = counts % 4.0
    return ((phase == 1.0) | (phase == 2.0)).astype(float), (phase >= 2.0).astype(float), \
        (counts % per_turn == 5.0).astype(float)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), borders=st.lists(st.integers(0, 2000), max_size=5))
def test_levels_in_pieces_give_the_count(seed: int, borders: list[int]) -> None:
    random = np.random.default_rng(seed)
    counts = np.cumsum(random.choice([-1.0, 0.0, 0.0, 1.0, 1.0], 2000))
    a, b, index = levels(counts, 100.0)
    counter = Quadrature(100.0)
    cuts = [0, *sorted(borders), 2000]
    parts = [counter.add(a[i:j], b[i:j], index[i:j]) for i, j in itertools.pairwise(cuts) if i < j]
    np.testing.assert_array_equal(np.concatenate(parts), counts - counts[0])
    assert counter.corrected == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_levels_with_an_index_lead_to_the_pitches_of_the_count(tmp_path: Path, sign: float) -> None:
    """Counts that are lost in every third turn are corrected by the index, which is angle zero."""
    counts = np.floor(np.arange(0.0, 12.3 * 400.0, 0.4)) + 130.0
    revs = np.arange(0.0, 12.3 * 400.0, 0.4) / 400.0 + 130.0 / 400.0
    a, b, index = levels(sign * counts, 400.0)
    path = write(tmp_path / "levels.csv", A=a, B=b, Z=index, z_mm=LEAD * revs + 1e-2 * np.sin(2.0 * revs))
    choice = ColumnChoice("A", "z_mm", angle_b="B", index="Z", counts_per_turn=400.0)
    (group,) = pitch_tables(path, choice)
    zero = 5.0 if sign > 0.0 else -4.0  # the edge by which the pulse begins
    whole = thread_pitch(TURN * (np.floor(counts) - zero) / 400.0, 1e-3 * (LEAD * revs + 1e-2 * np.sin(2.0 * revs)))
    both = whole.pitch[0, 1:11]
    np.testing.assert_allclose(group.table.pitch[0][~np.isnan(group.table.pitch[0])][:10], both, rtol=0.0, atol=6e-6)
    assert any("set by 12 index pulses; 0 counts were corrected" in note for note in group.table.notes)
    (streamed,) = stream_pitches(path, choice)
    np.testing.assert_array_equal(streamed.table.pitch, group.table.pitch)


def test_lost_counts_are_corrected_and_what_cannot_be_counted_is_refused(tmp_path: Path, threadpitch: Command) -> None:
    counts = np.floor(np.arange(0.0, 5000.0, 0.4))
    lost = counts - 2.0 * np.floor(counts / 1000.0)  # two counts in every 1000
    a, b, _ = levels(lost, 400.0)
    pulse = (counts % 400.0 == 5.0).astype(float)
    counter = Quadrature(400.0)
    found = counter.add(a, b, pulse)
    assert counter.corrected == 8.0
    rises = np.flatnonzero(np.diff(pulse) > 0.0) + 1
    np.testing.assert_array_equal(found[rises] % 400.0, 5.0)
    with pytest.raises(LevelError, match=r"the index comes 0\.400 turns after the first one; are 1000 counts"):
        Quadrature(1000.0).add(a, b, pulse)
    a[301:] = 1.0 - a[301:]
    b[301:] = 1.0 - b[301:]
    path = write(tmp_path / "levels.csv", A=a, B=b, z_mm=counts)
    assert_one_line(threadpitch("analyze", path, "--angle", "A", "--angle-b", "B", "--counts-per-turn", 400).err,
                    r"levels\.csv:303: A and B change at once, so that the direction is lost")
    assert_one_line(threadpitch("analyze", path, "--angle", "A", "--angle-b", "B").err, "need both columns and the c")
    assert_one_line(threadpitch("analyze", path, "--angle", "A", "--index", "B").err, "name the column of B too")


def test_degrees_that_begin_below_zero_are_wrapped_degrees(tmp_path: Path) -> None:
    turns = np.arange(0.0, 6.0, 0.013)
    path = write(tmp_path / "log.csv", a_deg=(360.0 * turns + 5.0) % 360.0 - 6.0, z_mm=LEAD * turns)
    (group,) = pitch_tables(path, ColumnChoice("a_deg", "z_mm"))
    np.testing.assert_allclose(group.table.pitch[0, 1:], 1e-3 * LEAD, rtol=0.0, atol=1e-12)
