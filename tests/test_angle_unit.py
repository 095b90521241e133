"""An angle without a unit: its samples tell the unit where only one is possible, and never a wrong one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import pitch_tables, stream_pitches
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, TraceError
from threadpitch.trace.angle_unit import PERIODS, angle_unit

TIME: FloatArray = 1e-3 * np.arange(3000.0)
REVS: FloatArray = 8.3 * TIME + 0.01 * np.sin(9.0 * TIME)  # about 500 rpm


def write(path: Path, angle: FloatArray, header: str = "time,Spindelwinkel,z", revs: FloatArray = REVS) -> Path:
    rows = np.column_stack([TIME, angle, 1.5 * revs])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header=header, comments="")
    return path


@st.composite
def spindles(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """(time, continuous turns): any speed, rate, length, direction, ripple, resolution, and a standstill before."""
    speed = draw(st.floats(0.1, 30_000.0)) / 60.0  # turns per s
    rate = draw(st.sampled_from([10.0, 100.0, 250.0, 1000.0, 1024.0, 1e4, 1e5]))
    time = np.arange(draw(st.integers(2, 5000))) / rate
    ripple = draw(st.floats(0.0, 0.05)) * np.sin(draw(st.floats(0.1, 20.0)) * time)
    turns = draw(st.floats(-3.0, 3.0)) + draw(st.sampled_from([1.0, -1.0])) * (speed * time + ripple)
    counts = draw(st.sampled_from([0, 100, 1024, 4096, 1 << 20]))
    standing = draw(st.integers(0, 100))
    turns = np.concatenate([np.full(standing, turns[0]), turns])
    time = np.concatenate([time[0] - np.arange(standing, 0, -1) / rate, time])
    return time, np.rint(counts * turns) / counts if counts else turns


def in_unit(turns: FloatArray, unit: str, wrapped: str) -> FloatArray:
    if wrapped == "from zero":
        turns = turns - np.floor(turns)
    elif wrapped == "about zero":
        turns = turns - np.rint(turns)
    return turns * PERIODS[unit]


@settings(max_examples=300, deadline=None)
@given(spindles(), st.sampled_from([*PERIODS]), st.sampled_from(["", "from zero", "about zero"]), st.integers(3, 9),
       st.booleans())
@example((0.01 * np.arange(15.0), 5.0 * np.arange(15.0)), "rad", "", 3, True)  # 30,000 rpm, rounded up
def test_a_unit_is_right_or_not_told(spindle: tuple[FloatArray, FloatArray], unit: str, wrapped: str,
                                     digits: int, timed: bool) -> None:
    time, turns = spindle
    angle = np.round(in_unit(turns, unit, wrapped), digits)
    assert angle_unit(angle, np.round(time, digits) if timed else None)[0] in ("", unit)


@settings(max_examples=100, deadline=None)
@given(spindles(), st.sampled_from([1024, 4096, 65536, 1 << 20]), st.booleans(), st.booleans())
def test_counts_are_not_told(spindle: tuple[FloatArray, FloatArray], counts: int, wrapped: bool,
                             timed: bool) -> None:
    time, turns = spindle
    angle = np.rint(counts * turns)
    assert angle_unit(angle % counts if wrapped else angle, time if timed else None) == ("", "")


@settings(max_examples=100, deadline=None)
@given(st.floats(1.0, 20_000.0), st.floats(8.0, 2000.0), st.sampled_from([*PERIODS]), st.booleans(), st.booleans())
def test_a_wrapped_angle_is_always_told(rpm: float, per_turn: float, unit: str, backward: bool, timed: bool) -> None:
    """Three turns and more with eight samples in each."""
    time = np.arange(4.0 * per_turn) * 60.0 / rpm / per_turn
    turns = (-1.0 if backward else 1.0) * time * rpm / 60.0 + 0.3
    assert angle_unit(in_unit(turns, unit, "from zero"), time if timed else None)[0] == unit


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 29_999.0), st.floats(3.0, 2000.0))  # at 30,000 rounding decides
def test_continuous_degrees_are_told_from_576_rpm_on(rpm: float, per_turn: float) -> None:
    time = np.arange(4.0 * per_turn) * 60.0 / max(rpm, 1.0) / per_turn
    found = angle_unit(6.0 * rpm * time + 0.5, time)[0]
    assert found == ("deg" if rpm > 33_000.0 * TURN / 360.0 else "")


@pytest.mark.parametrize("angle", [
    np.zeros(100), np.full(100, np.nan), np.empty(0), np.array([0.5]),
    np.tile([0.0, 359.0], 50), 180.0 + 0.1 * np.sin(np.arange(1000.0)),
    np.random.default_rng(1).uniform(0.0, 360.0, 1000), np.tile(np.linspace(0.0, 5.0, 90), 4),
    np.tile(np.linspace(0.0, 350.0, 90), 4), np.tile(np.linspace(0.0, 5.9, 300), 4),
], ids=["still", "nan", "empty", "one", "two values", "swaying", "noise", "passes of 5", "passes of 350",
        "passes of 5.9"])
def test_what_does_not_turn_is_not_told(angle: FloatArray) -> None:
    assert angle_unit(angle, None) == ("", "")
    assert angle_unit(angle, 1e-3 * np.arange(float(angle.size))) == ("", "")


@pytest.mark.parametrize(("unit", "of"), [("deg", lambda revs: 360.0 * revs % 360.0),
                                          ("rad", lambda revs: TURN * revs % TURN),
                                          ("rev", lambda revs: revs % 1.0)])
def test_the_same_pitches_as_with_the_unit(tmp_path: Path, unit: str, of: Callable[[FloatArray], FloatArray]) -> None:
    path = write(tmp_path / "log.csv", of(REVS))
    (told,) = stream_pitches(path, ColumnChoice(angle_unit=unit))
    (found,) = stream_pitches(path, ColumnChoice())
    (whole,) = pitch_tables(path, ColumnChoice())
    assert found.table.pitch.tobytes() == told.table.pitch.tobytes() == whole.table.pitch.tobytes()
    assert found.table.notes == whole.table.notes
    note = next(note for note in found.table.notes if note.startswith("angle: "))
    assert note == (f"angle: column 'Spindelwinkel' has no unit: taken as {unit}, because it begins again at "
                    f"{PERIODS[unit]:.6g}; --angle-unit overrules it")
    assert not any(note.startswith("angle: ") for note in told.table.notes)


def test_only_the_first_pass_is_looked_at(tmp_path: Path) -> None:
    """Turns that are counted from zero in every pass are no radians, though they fall by about 2 pi there."""
    revs = 6.283 * (np.arange(3000.0) % 600.0) / 600.0
    path = tmp_path / "log.csv"
    rows = np.column_stack([TIME, revs, 1.5 * revs, 1.0 + np.arange(3000) // 600])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header="time,angle,z,pass", comments="")
    groups = stream_pitches(path, ColumnChoice())
    assert [group.table.pitch.shape for group in groups] == [(1, 6)] * 5
    assert "angle: column 'angle' has no unit: taken as rev; --angle-unit overrules it" in groups[0].table.notes


def test_a_period_that_is_given_says_more_than_the_samples(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", 360.0 * REVS % 360.0)
    with pytest.raises(TraceError, match="turns back"):
        stream_pitches(path, ColumnChoice(), signals=Signals(angle_wrap=0.0))


def test_an_assumed_unit_is_refused_where_it_cannot_be(tmp_path: Path, threadpitch: Command) -> None:
    path = write(tmp_path / "log.csv", 360.0 * REVS)  # 498 rpm, or 28,500 in radians
    for ran in (threadpitch("analyze", path), threadpitch("analyze", path, "--crossing", "edges")):
        assert ran.status == 2
        assert_one_line(ran.err, r"is the unit of the angle really rev\? Give it: --angle-unit deg or count")
    document = json.loads(threadpitch("analyze", path, "--angle-unit", "deg", "--json").out)
    assert document["groups"][0]["mean_mm"] == [pytest.approx(1.5, abs=1e-5)]


def test_watch_takes_turns_says_so_and_stops_where_they_cannot_be(tmp_path: Path, threadpitch: Command) -> None:
    path = write(tmp_path / "log.csv", REVS % 1.0)
    ran = threadpitch("watch", path, "--idle", "0", "--json")
    assert ran.status == 0
    assert ran.err == ("threadpitch: note: angle: column 'Spindelwinkel' has no unit: taken as rev; --angle-unit "
                       "overrules it\n")
    path = write(tmp_path / "log.csv", 360.0 * REVS)
    ran = threadpitch("watch", path, "--idle", "0", "--json")
    assert (ran.status, ran.out) == (2, "")
    assert "is the unit of the angle really rev?" in ran.err.splitlines()[-1]


def test_counts_per_turn_alone_mean_counts(tmp_path: Path) -> None:
    path = write(tmp_path / "log.csv", np.rint(4096.0 * REVS) % 65536.0)
    (group,) = stream_pitches(path, ColumnChoice(counts_per_turn=4096.0))
    assert group.table.mean[0] == pytest.approx(1.5e-3, abs=1e-6)
    assert not any(note.startswith("angle: ") for note in group.table.notes)


@pytest.mark.parametrize("speed", [100.0, 200.0, 300.0, 510.0])
@pytest.mark.parametrize("named", ["time,Spindelwinkel,z", "n,Spindelwinkel,z"])
def test_continuous_degrees_are_not_taken_for_turns_that_wrap_in_every_sample(tmp_path: Path, named: str,
                                                                              speed: float) -> None:
    """In rev the spindle would turn by 0.6 to 3 turns in a sample: in pieces as in the whole."""
    revs = speed / 60.0 * TIME + 1e-3 * np.sin(9.0 * TIME)
    path = write(tmp_path / "log.csv", 360.0 * revs, named, revs)
    for way in (pitch_tables, stream_pitches):
        with pytest.raises(TraceError, match=r"turns in .*; is the unit of the angle really rev"):
            way(path, ColumnChoice())
