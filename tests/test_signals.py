"""Signals as machines give them lead to the pitches of the continuous ones, and what was done is listed."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from threadpitch.pitch import pitch_tables, stream_pitches, thread_pitch
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, TraceError, text_rows
from threadpitch.trace.conditioned import Samples
from threadpitch.trace.signals import Continuous, estimated_latency
from threadpitch.trace.standing import Standing

TIME: FloatArray = 1e-3 * np.arange(3000.0)
REVS: FloatArray = 8.0 * TIME + 0.05 * np.sin(11.0 * TIME)
Z: FloatArray = 1.5 * REVS + 0.003 * np.sin(2.0 * REVS)  # mm
COUNTS = np.floor(4096.0 * REVS)


def write(path: Path, **columns: FloatArray) -> Path:
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def read(path: Path, choice: ColumnChoice, signals: Signals | None = None) -> tuple[FloatArray, tuple[str, ...]]:
    (group,) = pitch_tables(path, choice, (0.0,), signals)
    return group.table.pitch[0], group.table.notes


CONTINUOUS = thread_pitch(TURN * REVS, 1e-3 * Z).pitch[0]
OF_COUNTS = thread_pitch(TURN / 4096.0 * COUNTS, 1e-3 * Z).pitch[0]


@pytest.mark.parametrize(("angle", "unit", "counts"), [
    (360.0 * (REVS % 1.0), "deg", None),
    ((360.0 * REVS + 180.0) % 360.0 - 180.0, "deg", None),
    (REVS % 1.0, "rev", None),
    (TURN * (REVS % 1.0), "rad", None),
    (-REVS % 1.0, "rev", None),
    (COUNTS % 4096.0, "count", 4096.0),
    (COUNTS % 65536.0, "count", 4096.0),
    ((COUNTS + 32768.0) % 65536.0 - 32768.0, "count", 4096.0),
    (-COUNTS, "count", 4096.0),
])
def test_wrapped_angles_are_found_and_made_continuous(tmp_path: Path, angle: FloatArray, unit: str,
                                                      counts: float | None) -> None:
    path = write(tmp_path / "log.csv", a=angle, z=Z)
    pitch, notes = read(path, ColumnChoice("a", "z", unit, counts_per_turn=counts))
    expected = OF_COUNTS if counts else CONTINUOUS
    np.testing.assert_allclose(pitch, expected, rtol=0.0, atol=4e-7 if angle[1] < 0.0 else 1e-12)
    assert any("wraps at" in note or "counts down" in note for note in notes)


@settings(deadline=None, max_examples=100)
@given(bits=st.integers(8, 32), seed=st.integers(0, 2**32 - 1), borders=st.lists(st.integers(0, 500), max_size=6))
def test_a_counter_of_any_width_is_continuous_again(bits: int, seed: int, borders: list[int]) -> None:
    steps = np.random.default_rng(seed).integers(-5, 2 ** (bits - 1) - 1, 500)
    counts = np.cumsum(steps).astype(np.float64)
    signal = Continuous("angle", 2.0**bits, math.inf)
    cuts = sorted(borders)
    parts = [signal.add(counts[a:b] % 2.0**bits) for a, b in zip([0, *cuts], [*cuts, 500], strict=True)]
    found = np.concatenate(parts)
    np.testing.assert_array_equal(found - found[0], counts - counts[0])


def test_an_index_that_resets_a_count_corrects_what_was_lost(tmp_path: Path) -> None:
    """3 counts are lost in every turn; the index sets the counter to zero."""
    phase = REVS % 1.0
    path = write(tmp_path / "log.csv", a=np.floor(4093.0 * phase), z=Z)
    pitch, notes = read(path, ColumnChoice("a", "z", "count", counts_per_turn=4096.0))
    np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=2e-6)
    assert any("wraps at 4096" in note for note in notes)


def test_the_feed_as_angle_of_its_motor(tmp_path: Path) -> None:
    motor = 2.5 * Z / 10.0  # turns of the motor: screw 10 mm, gear ratio 2.5
    ticks = 2.0**20 * motor
    for unit, values, counts in (("rev", motor, None), ("deg", 360.0 * motor, None), ("count", ticks, 2.0**20)):
        path = write(tmp_path / "log.csv", revs=REVS, motor=values)
        signals = Signals(screw_lead=0.010, gear_ratio=2.5, position_counts_per_turn=counts)
        pitch, notes = read(path, ColumnChoice("revs", "motor", position_unit=unit), signals)
        np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=1e-12)
        assert any("screw lead 10 mm, gear ratio 2.5" in note for note in notes)
    path = write(tmp_path / "log.csv", revs=REVS, motor=np.floor(2.0**20 * motor) % 65536.0)
    signals = Signals(screw_lead=0.010, gear_ratio=2.5, position_counts_per_turn=2.0**20, position_wrap=65536.0)
    pitch, _ = read(path, ColumnChoice("revs", "motor", position_unit="count"), signals)
    np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=1e-8)


def test_a_latency_is_taken_away_and_can_be_estimated(tmp_path: Path) -> None:
    late = np.interp(TIME - 0.004, TIME, 1.5 * REVS)
    path = write(tmp_path / "log.csv", time_s=TIME, revs=REVS, z_mm=late)
    choice = ColumnChoice("revs", "z_mm")
    uncorrected, _ = read(path, choice)
    assert abs(uncorrected[1:-1] - 1.5e-3).max() > 3e-6
    for latency in (0.004, math.nan):
        pitch, notes = read(path, choice, Signals(latency=latency))
        assert abs(pitch[1:-1] - 1.5e-3).max() < 1e-7
        assert any("4 ms later" in note or "3.99" in note or "4.00" in note for note in notes)
    assert any("with a standard uncertainty of " in note for note in notes)
    even = write(tmp_path / "even.csv", time_s=TIME, revs=8.0 * TIME, z_mm=12.0 * TIME)
    with pytest.raises(TraceError, match="the spindle's speed does not vary; give it as a number"):
        read(even, choice, Signals(latency=math.nan))
    without = write(tmp_path / "without.csv", revs=REVS, z_mm=Z)
    with pytest.raises(TraceError, match="a latency needs the time of the samples"):
        read(without, choice, Signals(latency=0.001))


@pytest.mark.parametrize(("ripple", "turns"), [(0.005, 40.0), (0.02, 40.0), (0.02, 6.0)])
def test_a_latency_is_estimated_without_a_bias(ripple: float, turns: float) -> None:
    """Averaging must not weaken a ripple faster than the spindle, in a long recording no more than in a short one."""
    time = np.arange(0.0, turns / 5.0, 2e-4)
    revs = 5.0 * time + ripple * np.sin(44.0 * time)
    late = np.interp(time - 0.003, time, 1.5e-3 * revs)
    for angle in (revs, np.floor(4096.0 * revs) / 4096.0):
        latency, uncertainty = estimated_latency(time, TURN * angle, late)
        assert abs(latency - 0.003) < 3e-5
        assert 0.0 < uncertainty < 1e-4


@pytest.mark.parametrize(("ripple", "most"), [(0.06, 2e-4), (0.002, 5e-3)])
def test_the_uncertainty_of_an_estimated_latency_holds_its_error(ripple: float, most: float) -> None:
    """A weak ripple beside a screw error of 2 um tells little, which is said."""
    time = 1e-3 * np.arange(6000.0)

    def turned(at: FloatArray, phase: float) -> FloatArray:
        return 8.3 * (at + ripple / (14.0 * np.pi) * np.sin(14.0 * np.pi * at + phase))

    for phase in np.linspace(0.0, TURN, 10, endpoint=False):
        revs = turned(time, float(phase))
        late = 1.5e-3 * turned(time - 0.003, float(phase)) + 2e-6 * np.sin(TURN * revs / 6.67)
        latency, uncertainty = estimated_latency(time, TURN * np.floor(4096.0 * revs) / 4096.0, late)
        assert abs(latency - 0.003) < 2.0 * uncertainty < most


def test_a_quantised_angle_at_even_speed_tells_no_latency() -> None:
    time = np.arange(0.0, 8.0, 2e-4)
    revs = 5.0 * time
    with pytest.raises(TraceError, match="the spindle's speed does not vary"):
        estimated_latency(time, TURN * np.floor(4096.0 * revs) / 4096.0, 1.5e-3 * (revs - 0.015))


@pytest.mark.parametrize("late", [3, -3])
def test_a_latency_leaves_out_the_end_that_one_signal_lacks(tmp_path: Path, late: int) -> None:
    """The position of sample k was recorded with sample k + late; held at an end it would be a turn too short."""
    shifted = np.roll(Z, late)[max(late, 0) : Z.size + min(late, 0)]
    kept = slice(max(late, 0), Z.size + min(late, 0))
    path = write(tmp_path / "log.csv", time=TIME[kept], revs=REVS[kept], z_mm=shifted)
    pitch, notes = read(path, ColumnChoice(), Signals(latency=1e-3 * late))
    there = slice(2 * max(late, 0) - late, Z.size + 2 * min(late, 0) - late)
    whole = thread_pitch(TURN * REVS[there], 1e-3 * Z[there]).pitch[0]
    np.testing.assert_allclose(pitch, whole, rtol=0.0, atol=1e-12)
    assert any("ms later than recorded" in note for note in notes)


def test_a_latency_that_is_longer_than_the_recording_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", time=TIME, revs=REVS, z_mm=Z)
    with pytest.raises(TraceError, match="latency of 1e\\+06 ms is longer than the recording, 2999 ms"):
        read(path, ColumnChoice(), Signals(latency=1e3))


@pytest.mark.parametrize("missing", [0.03, 0.5])
def test_turns_that_a_wrapped_angle_lost_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                     missing: float) -> None:
    """A quarter of a turn can be bridged, four turns cannot; in pieces as in the whole."""
    kept = (TIME < 1.1) | (1.1 + missing < TIME)
    path = write(tmp_path / "log.csv", time=TIME[kept], angle_deg=(360.0 * REVS % 360.0)[kept], z_mm=Z[kept])
    if missing < 0.1:
        pitch, _ = read(path, ColumnChoice())
        np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=2e-5)
        return
    for block in (text_rows.BLOCK, 3000):
        monkeypatch.setattr(text_rows, "BLOCK", block)
        with pytest.raises(TraceError, match=r"wraps at 360, went round about [34]\.\d times: part the recording"):
            stream_pitches(path, ColumnChoice(), (0.0,))
    continuous = write(tmp_path / "revs.csv", time=TIME[kept], revs=REVS[kept], z_mm=Z[kept])
    pitch, notes = read(continuous, ColumnChoice())
    assert pitch.size == CONTINUOUS.size
    assert any(re.match(r"about [34]\.\d turns passed while samples were missing: their P", note) for note in notes)


def test_missing_and_repeated_samples_are_listed(tmp_path: Path) -> None:
    kept = np.sort(np.concatenate([np.delete(np.arange(3000), slice(700, 705)), [100, 100, 2000]]))
    path = write(tmp_path / "log.csv", time_s=TIME[kept], revs=REVS[kept], z_mm=Z[kept])
    pitch, notes = read(path, ColumnChoice("revs", "z_mm"))
    np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=1e-7)
    assert "3 samples are there twice: left out" in notes
    assert any(note.startswith("samples are missing in 1 places, 0.006 s at most") for note in notes)


def test_outliers_are_mended_and_a_stuck_sensor_is_named(tmp_path: Path) -> None:
    spoiled = Z.copy()
    spoiled[[500, 1250, 1251 + 500]] += (3.0, -0.2, 0.05)
    path = write(tmp_path / "log.csv", revs=REVS, z_mm=spoiled)
    pitch, notes = read(path, ColumnChoice("revs", "z_mm"), Signals(outlier=0.02e-3))
    np.testing.assert_allclose(pitch, CONTINUOUS, rtol=0.0, atol=1e-8)
    assert "3 positions stuck out by more than 0.02 mm: put between their neighbours" in notes
    path = write(tmp_path / "stuck.csv", revs=REVS, z_mm=np.where(TIME > 1.5, Z[1500], Z))
    _, notes = read(path, ColumnChoice("revs", "z_mm"))
    assert notes[-1].startswith("the position does not move in 12 turns, the first of them 13")


def test_an_angle_that_stands_while_the_feed_moves_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "log.csv", revs=np.minimum(REVS, REVS[1500]), z_mm=Z)
    moved = abs(Z[-1] - Z[1500])
    for block in (text_rows.BLOCK, 3000):
        monkeypatch.setattr(text_rows, "BLOCK", block)
        (group,) = stream_pitches(path, ColumnChoice())
        assert f"stands still at the end, while the position moves by {moved:.4g} mm" in group.table.notes[-1]
    for still in (write(tmp_path / "whole.csv", revs=REVS, z_mm=Z),
                  write(tmp_path / "both.csv", revs=np.minimum(REVS, REVS[1500]), z_mm=np.minimum(Z, Z[1500]))):
        assert not any("stands still" in note for note in read(still, ColumnChoice())[1])


def test_a_position_that_never_moves_is_named(tmp_path: Path) -> None:
    pitch, notes = read(write(tmp_path / "log.csv", revs=REVS, z_mm=np.ones(REVS.size)), ColumnChoice())
    assert not pitch.any()
    assert "does not move in any turn" in notes[-1]


def test_a_reversal_is_named_where_it_stands_in_the_file(tmp_path: Path) -> None:
    """The angle ends below its beginning, but it was not turned around for that."""
    revs = np.concatenate([np.arange(0.0, 3.0, 0.1), np.arange(3.0, -4.0, -0.1)])
    with pytest.raises(TraceError, match=r"log\.csv:33: the spindle turns back from 3\.0000 to 2\.9000 turns"):
        read(write(tmp_path / "log.csv", revs=revs, z_mm=np.arange(100.0)), ColumnChoice("revs", "z_mm"))


@settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(block=st.integers(20, 9000))
def test_a_log_in_pieces_gives_the_bits_of_the_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                     block: int) -> None:
    path = write(tmp_path / "log.csv", time=TIME, angle=COUNTS % 65536.0, z=-Z,
                 group=np.where(TIME < 0.1, 0.0, np.where(TIME < 1.5, 1.0, 2.0)))
    choice = ColumnChoice("angle", "z", "count", "mm", "group", counts_per_turn=4096.0)
    whole = pitch_tables(path, choice, (0.0, 1.0))
    monkeypatch.setattr(text_rows, "BLOCK", block)
    pieces = stream_pitches(path, choice, (0.0, 1.0))
    assert [one.label for one in pieces] == [one.label for one in whole]
    for one, other in zip(pieces, whole, strict=True):
        np.testing.assert_array_equal(one.table.pitch, other.table.pitch)
        assert one.table.notes == other.table.notes


@pytest.mark.parametrize(("signals", "message"), [
    ({"screw_lead": -1.0}, "screw lead is -1.0; give a positive number"),
    ({"gear_ratio": 0.0}, "gear ratio is 0.0; give a positive number"),
    ({"angle_wrap": -1.0}, "angle wrap is -1.0; give the period"),
    ({"position_wrap": math.inf}, "position wrap is inf; give the period"),
])
def test_signals_that_cannot_be_are_refused(signals: dict[str, Any], message: str) -> None:
    with pytest.raises(TraceError, match=message):
        Signals(**signals)


def stuck(first: int, last: int) -> FloatArray:
    """The angle when its sensor stands between two samples, and the turns in between are lost."""
    steps = np.diff(REVS, prepend=REVS[0])
    steps[first + 1 : last] = 0.0
    angle: FloatArray = REVS[0] + np.cumsum(steps)
    return angle


def test_an_angle_that_is_stuck_for_a_while_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "log.csv", time_s=TIME, revs=stuck(1000, 1200), z_mm=Z)
    moved = Z[1199] - Z[1000]  # 1.6 turns
    expected = ("the angle stands still from line 1002 (1 s) to line 1201 (1.199 s), "
                f"{REVS[1000] - REVS[0]:.1f} turns after the first sample, while the position moves by "
                f"{moved:.4g} mm")
    found = set()
    for block in (text_rows.BLOCK, 3000, 777):
        monkeypatch.setattr(text_rows, "BLOCK", block)
        (streamed,) = stream_pitches(path, ColumnChoice())
        (whole,) = pitch_tables(path, ColumnChoice())
        found |= {streamed.table.notes, whole.table.notes}
        assert streamed.table.pitch.max() > 2.5 * 1.5e-3
    (notes,) = found
    assert sum(expected in note for note in notes) == 1


@pytest.mark.parametrize("last", [1030, 1110])
def test_a_short_stand_of_the_angle_is_not_named(tmp_path: Path, last: int) -> None:
    """The feed moves by less than in a turn."""
    path = write(tmp_path / "log.csv", time_s=TIME, revs=stuck(1000, last), z_mm=Z)
    _, notes = read(path, ColumnChoice())
    assert not any("stands still" in note for note in notes)


@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), borders=st.lists(st.integers(0, 400), max_size=8), end=st.booleans())
def test_stands_are_the_same_in_pieces(seed: int, borders: list[int], end: bool) -> None:
    random = np.random.default_rng(seed)
    lengths = random.integers(1, 60, 40)
    angle = np.repeat(np.cumsum(random.uniform(0.1, 3.0, lengths.size)), lengths)[:400]
    angle[380:] = angle[380] if end else angle[380:]
    position = np.cumsum(random.uniform(0.0, 1e-3, angle.size))
    cuts = sorted(min(border, angle.size) for border in borders)
    pieces, whole = Standing(), Standing()
    whole.add(Samples(angle, 0.1, position, 1e-3))
    for a, b in zip([0, *cuts], [*cuts, angle.size], strict=True):
        pieces.add(Samples(angle[a:b], 0.1, position[a:b], 1e-3))
    assert pieces.notes() == whole.notes()
    assert whole.notes() == of_every_stretch(angle, position)


def of_every_stretch(angle: FloatArray, position: FloatArray) -> list[str]:
    """The same by looking at every sample."""
    borders = [0, *(np.flatnonzero(np.diff(angle)) + 1).tolist(), angle.size]
    runs = list(pairwise(borders))
    moved = [1e-3 * float(position[b - 1] - position[a]) for a, b in runs]
    turns = 0.1 * float(angle[-1] - angle[0]) / TURN
    inner = [i for i, (a, b) in enumerate(runs[:-1]) if b - a >= 16]
    chosen = [max(inner, key=lambda i: moved[i])] if inner else []
    found = []
    for i in [*chosen, len(runs) - 1]:
        a, b = runs[i]
        elsewhere = 1e-3 * float(position[a] - position[0] + position[-1] - position[b - 1])
        if turns >= 1.0 and moved[i] > elsewhere / turns:
            place = "at the end" if i == len(runs) - 1 else (
                f"from sample {a} to sample {b - 1}, {0.1 * (angle[a] - angle[0]) / TURN:.1f} turns after the first "
                "sample")
            found.append(f"the angle stands still {place}, while the position moves by {1e3 * moved[i]:.4g} mm: is its "
                         "sensor stuck, or did the spindle stop?"
                         + ("" if i == len(runs) - 1 else " P(n) of that turn holds this movement too"))
    return found
