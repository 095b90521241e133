"""Passes that are found by the motion of the feed while the recording grows: those of the finished one, at once."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.conftest import Command, assert_one_line
from tests.test_passes_found import LEAD, LOGS, cycle, write
from threadpitch.pitch import pitch_tables, stream_pitches
from threadpitch.trace import TURN, ColumnChoice, FloatArray, Signals, read_groups
from threadpitch.trace.synchronous import CELL, Part, Synchronism

LEAD_SI = 1e-3 * LEAD
OPTIONS = {"index": ["--index-enable", "index_enable"], "lead": ["--synchronous", "--target", "1.5"],
           "synchronous": ["--synchronous"]}


def recording(seed: int) -> tuple[FloatArray, FloatArray]:
    """Angle and position of some passes, with noise, damaged samples, other feeds and an angle that begins anew."""
    random = np.random.default_rng(seed)
    angle: list[FloatArray] = []
    position: list[FloatArray] = []
    turns, place = 0.0, 0.0
    for _ in range(int(random.integers(1, 9))):
        feed = random.choice([0.0, LEAD_SI, -LEAD_SI, 0.4 * LEAD_SI, 1.1 * LEAD_SI, -12.0 * LEAD_SI])
        step = np.full(int(random.integers(10, 400)), random.choice([0.002, 0.01, 0.05]))
        if random.random() < 0.2:
            turns = 0.0
        angle.append(TURN * (turns + np.cumsum(step)))
        position.append(place + feed * np.cumsum(step))
        turns, place = turns + float(step.sum()), float(position[-1][-1])
    theta, xi = np.concatenate(angle), np.concatenate(position)
    if random.random() < 0.5:
        theta = CELL / 12.5 * np.floor(theta / (CELL / 12.5))
    xi = xi + random.choice([0.0, 1e-6, 1e-5]) * random.standard_normal(xi.size)
    xi[random.random(xi.size) < random.choice([0.0, 0.01])] = math.nan
    return theta, xi


def by_pass(parts: list[Part]) -> list[tuple[int, int]]:
    """(first, last) sample of every pass; its parts follow one another."""
    found: list[tuple[int, int]] = []
    for part in parts:
        if not part.opens:
            first, last = found.pop()
            assert last == part.first
            part = Part(first, part.last, opens=True, movement=part.movement)
        found.append((part.first, part.last))
    return found


@settings(deadline=None, max_examples=150)
@given(seed=st.integers(0, 2**32 - 1), lead=st.sampled_from([None, LEAD_SI]), start=st.booleans(),
       borders=st.lists(st.integers(0, 4000), max_size=40))
def test_passes_are_the_same_however_the_samples_come(seed: int, lead: float | None, start: bool,
                                                      borders: list[int]) -> None:
    theta, xi = recording(seed)
    whole = Synchronism(lead, from_the_start=start)
    wanted = by_pass([*whole.add(theta, xi), *whole.end()])
    grown = Synchronism(lead, from_the_start=start)
    parts: list[Part] = []
    for first, last in pairwise([0, *sorted(border for border in borders if border < theta.size), theta.size]):
        needed = grown.needed
        new = grown.add(theta[first:last], xi[first:last])
        assert all(part.first >= needed and part.last <= last for part in new)
        parts += new
    assert by_pass([*parts, *grown.end()]) == wanted
    assert all(one[1] <= other[0] for one, other in pairwise(wanted))


def test_a_sample_of_a_running_pass_is_known_at_once() -> None:
    """From a turn and a half on, and until the feed leaves the lead."""
    turns = np.arange(0.0, 12.0, 0.004)
    position = LEAD_SI * np.clip(turns, 2.0, 9.0) + 1e-6 * np.sin(TURN * turns)
    finder = Synchronism(LEAD_SI)
    upto: list[int] = []
    for k in range(turns.size):
        parts = finder.add(TURN * turns[k : k + 1], position[k : k + 1])
        upto.append(parts[-1].last if parts else (upto[-1] if upto else 0))
    known = np.array(upto)
    running = (turns > 2.0 + 1.5 + 0.26) & (turns < 9.0)
    np.testing.assert_array_equal(known[running], np.flatnonzero(running) + 1)
    assert 9.0 <= turns[known[-1] - 1] < 9.02


@pytest.mark.parametrize("how", OPTIONS)
def test_watching_gives_the_passes_of_analyze(tmp_path: Path, threadpitch: Command, how: str) -> None:
    path = write(tmp_path / "cycle.csv", **cycle())
    watched = [json.loads(line) for line in threadpitch(
        "watch", path, "--json", "--idle", "0", *OPTIONS[how]).out.splitlines()]
    document = json.loads(threadpitch("analyze", path, "--json", *OPTIONS[how]).out)
    assert [group["group"] for group in document["groups"]] == ["1", "2", "3"]
    for group in document["groups"]:
        told = [turn["pitch_mm"] for turn in watched if turn["group"] == group["group"]]
        assert told == [pitch for pitch in group["pitch_mm"][0] if pitch is not None]


def test_every_turn_of_a_real_log_is_known_with_its_sample() -> None:
    """Sample by sample: from the second turn on with the sample that completes it, until the feed brakes."""
    choice = ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass")
    for trace in read_groups(LOGS / "C_ripple_500.csv.gz", choice):
        finder = Synchronism(LEAD_SI)
        known = 0
        late: list[int] = []
        for k in range(trace.angle.size):
            parts = finder.add(trace.angle[k : k + 1], trace.position[k : k + 1])
            known = parts[-1].last if parts else known
            if k and math.floor(trace.angle[k] / TURN) > math.floor(trace.angle[k - 1] / TURN):
                late.append(k + 1 - known)
        assert len(late) >= 29
        assert late[1:-1] == [0] * len(late[1:-1])


def test_a_group_without_synchronous_motion_is_named_and_the_others_are_there(tmp_path: Path) -> None:
    columns = cycle()
    end = int(np.flatnonzero(np.diff(columns["index_enable"]) < 0.0)[2]) + 60  # the third pass has just begun
    path = write(tmp_path / "cut_off.csv", **{name: values[:end] for name, values in columns.items()})
    groups = pitch_tables(path, ColumnChoice("revs", "z_mm", index_enable="index_enable"))
    assert [group.label for group in groups] == ["1", "2"]
    assert any("left out, because the feed does not move in step" in note for note in groups[-1].table.notes)
    streamed = stream_pitches(path, ColumnChoice("revs", "z_mm", index_enable="index_enable"))
    for one, other in zip(streamed, groups, strict=True):
        np.testing.assert_array_equal(one.table.pitch, other.table.pitch)
        assert one.table.notes == other.table.notes


def test_an_angle_that_begins_anew_with_every_pass_has_all_its_passes() -> None:
    """LinuxCNC sets the turns to zero at the index."""
    for name, lead in (("A_ideal_500", 1.5e-3), ("J_twostart_400", 3e-3)):
        path = LOGS / f"{name}.csv.gz"
        flagged = pitch_tables(path, ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass"))
        found = stream_pitches(path, ColumnChoice("spindle_revs_encoder", "z_fb_mm"), (0.0,),
                               Signals(synchronous=True, lead=lead))
        assert len(found) == len(flagged)
        for one, other in zip(found, flagged, strict=True):
            turns = one.table.pitch.shape[1]
            assert other.table.pitch.shape[1] - 2 <= turns
            np.testing.assert_allclose(one.table.pitch[:, 1 : turns - 1], other.table.pitch[:, 1 : turns - 1],
                                       rtol=0.0, atol=1e-12)


def test_a_recording_without_a_pass_says_so(threadpitch: Command, tmp_path: Path) -> None:
    path = tmp_path / "still.csv"
    path.write_text("revs,z_mm\n" + "".join(f"{0.01 * k},1.0\n" for k in range(1000)))
    outcome = threadpitch("watch", path, "--synchronous", "--idle", "0")
    assert outcome.status == 2
    assert_one_line(outcome.err, "no synchronous motion of the feed over 1.5 turns was found")
