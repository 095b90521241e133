"""``threadpitch analyze``: logs to tables and JSON, and every fault of a log in one line with its place."""

from __future__ import annotations

import csv
import gzip
import json
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import pitch_tables
from threadpitch.trace import ColumnChoice

LOGS = Path(__file__).parents[1] / "models" / "logs" / "linuxcnc"
ENCODER = ("--angle", "spindle_revs_encoder", "--position", "z_fb_mm", "--group", "pass")
COLUMNS = ("--angle", "angle", "--position", "z", "--group", "pass")
HEADER = ("time", "angle", "z", "pass")
LEAD = 1.5  # mm
Row = tuple[Any, ...]
WriteLog = Callable[..., Path]


def turns(count: float = 3.0, label: object = 1, begin: float = 0.0, samples: int = 200) -> list[Row]:
    """(time s, angle rev, position mm, group) of a spindle that turns evenly, with the lead of 1.5 mm."""
    angles = np.linspace(0.0, count, samples + 1).tolist()
    return [(begin + 0.001 * i, angle, LEAD * angle, label) for i, angle in enumerate(angles)]


@pytest.fixture
def write_log(tmp_path: Path) -> WriteLog:
    def write(rows: Iterable[Row], header: Row = HEADER, name: str = "log.csv") -> Path:
        path = tmp_path / name
        with (gzip.open if name.endswith(".gz") else open)(path, "wt", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows(rows)
        return path

    return write


@pytest.fixture
def analyzed(threadpitch: Command) -> Callable[..., list[dict[str, Any]]]:
    """The groups of the JSON document."""

    def groups(path: Path, *options: object) -> list[dict[str, Any]]:
        outcome = threadpitch("analyze", path, *(options or COLUMNS), "--json")
        assert (outcome.status, outcome.err) == (0, "")
        document = json.loads(outcome.out)
        assert list(document) == ["groups"]
        return list(document["groups"])

    return groups


Analyzed = Callable[..., list[dict[str, Any]]]


def test_the_document_holds_the_pitches_of_every_group(analyzed: Analyzed) -> None:
    path = LOGS / "J_twostart_400.csv.gz"
    groups = analyzed(path, *ENCODER, "--start-angle", 0, 90, 180, 270)
    expected = pitch_tables(path, ColumnChoice("spindle_revs_encoder", "z_fb_mm", group="pass"),
                            np.radians([0, 90, 180, 270]))
    assert [group["group"] for group in groups] == ["1", "2"]
    for group, one in zip(groups, expected, strict=True):
        assert set(group) >= {"group", "start_angles_deg", "pitch_mm", "min_mm", "max_mm", "mean_mm"}
        assert group["start_angles_deg"] == [0.0, 90.0, 180.0, 270.0]
        found = np.array(group["pitch_mm"], dtype=np.float64)  # null becomes NaN
        np.testing.assert_allclose(found, 1e3 * one.table.pitch, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(group["min_mm"], 1e3 * one.table.minimum, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(group["max_mm"], 1e3 * one.table.maximum, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(group["mean_mm"], 1e3 * one.table.mean, rtol=0.0, atol=1e-12)


def test_a_turn_outside_the_log_is_null(write_log: WriteLog, analyzed: Analyzed) -> None:
    (group,) = analyzed(write_log(turns(2.5)), *COLUMNS, "--start-angle", 0, 180, 270, -90)
    assert [[pitch is None for pitch in row] for row in group["pitch_mm"]] == [
        [False, False], [False, False], [False, True], [True, False]]
    assert [pitch for row in group["pitch_mm"] for pitch in row if pitch is not None] == pytest.approx([LEAD] * 6)


def test_one_start_angle_of_zero_is_the_default(write_log: WriteLog, analyzed: Analyzed) -> None:
    (group,) = analyzed(write_log(turns()))
    assert group["start_angles_deg"] == [0.0]
    assert group["pitch_mm"] == [pytest.approx([LEAD] * 3)]


def test_rows_without_a_group_are_left_out(write_log: WriteLog, analyzed: Analyzed) -> None:
    """Their angles run wild; a group's value that comes again after them is a group of its own."""
    rows = turns(label="A")
    for idle in (0, "", "false", "0.0", "FALSE"):
        rows += [(9.0, -7.0, math.nan, idle)]
    rows += turns(label="A", begin=10.0) + turns(label="2.0", begin=20.0)
    assert [group["group"] for group in analyzed(write_log(rows))] == ["A", "A (2)", "2"]


def test_compressed_logs_and_negative_feed(write_log: WriteLog, analyzed: Analyzed) -> None:
    rows: list[Row] = [(time, angle, -LEAD * float(str(angle)), label) for time, angle, _, label in turns()]
    (group,) = analyzed(write_log(rows, name="log.csv.gz"))
    assert group["pitch_mm"] == [pytest.approx([LEAD] * 3)]


def test_counts_with_plateaus_and_jitter(write_log: WriteLog, analyzed: Analyzed) -> None:
    rows: list[Row] = []
    for time, angle, position, label in turns(samples=3000):
        jitter = 1 if len(rows) % 7 == 3 else 0
        rows.append((time, math.floor(400.0 * float(str(angle))) - jitter, position, label))
    counts = ("--angle-unit", "count", "--counts-per-turn", 400)
    (group,) = analyzed(write_log(rows), *COLUMNS, *counts)
    assert group["pitch_mm"] == [pytest.approx([LEAD] * 3, abs=1.5 * LEAD / 400)]


def test_units_of_the_columns(write_log: WriteLog, analyzed: Analyzed) -> None:
    rows: list[Row] = [(time, 360.0 * float(str(angle)), LEAD / 25.4 * float(str(angle)), label)
                       for time, angle, _, label in turns()]
    (group,) = analyzed(write_log(rows), *COLUMNS, "--angle-unit", "deg", "--position-unit", "inch")
    assert group["pitch_mm"] == [pytest.approx([LEAD] * 3)]


def test_a_start_just_before_the_log_is_extrapolated_and_marked(
        write_log: WriteLog, analyzed: Analyzed, threadpitch: Command) -> None:
    rows: list[Row] = [(time, float(str(angle)) + 0.005, position, label) for time, angle, position, label in turns()]
    path = write_log(rows)
    (group,) = analyzed(path, *COLUMNS, "--start-angle", 0, 90)
    assert group["extrapolated"] == [True, False]
    assert group["pitch_mm"][0] == pytest.approx([LEAD] * 3)
    lines = threadpitch("analyze", path, *COLUMNS, "--start-angle", 0, 90).out.splitlines()
    assert [line for line in lines if "1.5000*" in line] == [line for line in lines if "|         360 " in line]
    assert any(line.startswith("* begins before the first sample") for line in lines)


def test_tables_of_every_group(threadpitch: Command) -> None:
    outcome = threadpitch("analyze", LOGS / "A_ideal_500.csv.gz", *ENCODER, "--start-angle", 0, 90, -90)
    assert (outcome.status, outcome.err) == (0, "")
    lines = outcome.out.splitlines()
    assert [line for line in lines if line.startswith("Group")] == ["Group 1", "Group 2"]
    assert "| angle [deg] | n [rev] |    0 deg |   90 deg |  -90 deg |" in lines
    assert "|         720 |       2 |   1.5000 |   1.5000 |   1.5000 |" in lines
    assert any(line.startswith("| theta_S3 = -90 deg |") for line in lines)
    assert outcome.out.isascii()


@pytest.mark.parametrize("width", [60, 80, 200])
def test_tables_keep_to_the_width(threadpitch: Command, monkeypatch: pytest.MonkeyPatch, write_log: WriteLog,
                                  width: int) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    outcome = threadpitch("analyze", write_log(turns()), *COLUMNS, "--start-angle", *range(0, 360, 45))
    lines = outcome.out.splitlines()
    assert max(map(len, lines)) <= width
    assert "…" not in outcome.out
    heads = [line for line in lines if line.startswith("|    Rotation |")]
    assert [head.count("theta_S") for head in heads] == {60: [3, 3, 2], 80: [4, 4], 200: [8]}[width]


def changed(rows: list[Row], place: int, *row: object) -> list[Row]:
    return [*rows[:place], tuple(row), *rows[place + 1 :]]


FAULTS = {
    "reversal": ([*turns(), (1.0, 2.5, LEAD * 2.5, 1)],
                 r"log\.csv:203: the spindle turns back from 3\.0000 to 2\.5000 turns; .*reversal; .*group column"),
    "nan in the angle": (changed(turns(), 10, 0.01, "nan", 0.2, 1),
                         r"log\.csv:12: angle is NaN; mend or leave out this sample"),
    "nan in the position": (changed(turns(), 10, 0.01, 0.15, "NaN", 1), r"log\.csv:12: position is NaN; mend"),
    "infinite": (changed(turns(), 10, 0.01, 0.15, "inf", 1), r"log\.csv:12: position is inf; mend"),
    "text": (changed(turns(), 10, 0.01, "abc", 0.2, 1), r"log\.csv:12: column 'angle' holds 'abc', not a number; mend"),
    "comma": (changed(turns(), 10, 0.01, "0,15", 0.2, 1), r"log\.csv:12: column 'angle' holds '0,15'.* as a point"),
    "nothing": (changed(turns(), 10, 0.01, "", 0.2, 1), r"log\.csv:12: column 'angle' is empty; mend or leave out"),
    "short row": (changed(turns(), 10, 0.01, 0.15), r"log\.csv:12: "),
    "time back": (changed(turns(), 10, 0.001, 0.15, 0.2, 1), r"log\.csv:12: time runs back .*; sort the samples"),
    "less than a turn": (turns(0.9), r"log\.csv, group '1': the spindle turns 0\.9 of a turn; a pitch needs a whole"),
    "one sample": (turns()[:1], r"log\.csv, group '1': 1 samples; a pitch needs two"),
    "standing": ([(0.001 * i, 0.0, 0.1 * i, 1) for i in range(50)], r"group '1': the spindle turns 0 of a turn"),
    "no threading": (turns(label=0), r"log\.csv: no row is threading: column 'pass' is 0, empty or false everywhere; "
                                     "choose another group column or none"),
    "no rows": ([], r"log\.csv: there are no rows below the header"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_of_a_log(threadpitch: Command, write_log: WriteLog, fault: str) -> None:
    rows, message = FAULTS[fault]
    path = write_log(rows)
    outcome = threadpitch("analyze", path, *COLUMNS)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, message)


def test_a_group_of_less_than_a_turn_is_named(threadpitch: Command, write_log: WriteLog) -> None:
    path = write_log(turns() + turns(0.5, label=2, begin=1.0))
    outcome = threadpitch("analyze", path, *COLUMNS, "--json")
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, r"log\.csv, group '2': the spindle turns 0\.5 of a turn")


@pytest.mark.parametrize(("options", "message"), [
    (("--angle", "angel", "--position", "z"), r"log\.csv:1: there is no column 'angel'; nearest are 'angle'"),
    (("--angle", "angle", "--position", "x"), r"log\.csv:1: there is no column 'x'; nearest are .*'z'"),
    (("--angle", "angle", "--position", "z", "--group", "Pass"), r"there is no column 'Pass'; nearest are 'pass'"),
    (("--angle", "angle", "--position", "z", "--time", "t"), r"there is no column 't'; nearest are 'time'"),
    ((*COLUMNS, "--angle-unit", "grad"), r"'grad' is not a unit of the angle; known are rev, deg, rad and count"),
    ((*COLUMNS, "--angle-unit", "mm"), r"'mm' is not a unit of the angle"),
    ((*COLUMNS, "--position-unit", "deg"), r"'deg' is not a unit of the position; known are mm, m, um and inch"),
    ((*COLUMNS, "--angle-unit", "count"), r"the angle unit count needs the counts per turn"),
    ((*COLUMNS, "--angle-unit", "count", "--counts-per-turn", "0"), r"counts per turn is 0\.0; give a positive number"),
    ((*COLUMNS, "--counts-per-turn", "many"), r"'--counts-per-turn': 'many' is not a number; write it like"),
    ((*COLUMNS, "--angle-unit", "deg"), r"turns 0\.008333 of a turn; .*is the unit of the angle right\?"),
    ((*COLUMNS, "--start-angle"), r"'--start-angle' requires an argument; see threadpitch"),
    ((*COLUMNS, "--start-angle", "361"), r"start angle 361 degrees is more than a turn; give angles from -360 to 360"),
    ((*COLUMNS, "--start-angle", "nan"), r"'nan' is not finite"),
    ((*COLUMNS, "--start-angle", "0", "nan"), r"'nan' is not finite"),
    ((*COLUMNS, "--colour"), r"[Nn]o such option: --colour.*; see threadpitch analyze --help"),
    ((*COLUMNS, "second.csv"), r"unexpected extra argument.*second\.csv.*; see threadpitch analyze --help"),
    (("--angle", "angle", "--latency", "long"), r"'--latency': 'long' is not a number; write it like"),
    ((*COLUMNS, "--screw-lead", "-5"), r"screw lead is -0\.005; give a positive number"),
    ((*COLUMNS, "--gear-ratio", "3"), r"--gear-ratio and --position-counts-per-turn are .*; give --screw-lead"),
    ((*COLUMNS, "--screw-lead", "5"), r"'mm' is not a unit of the motor's angle; with a screw lead"),
])
def test_wrong_options(threadpitch: Command, write_log: WriteLog, options: tuple[str, ...], message: str) -> None:
    outcome = threadpitch("analyze", write_log(turns()), *options)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, message)


def test_every_pitch_by_edges_has_its_uncertainty_beside_it(threadpitch: Command, write_log: WriteLog) -> None:
    log = write_log([(time, angle, z + 1e-4 * math.sin(37e3 * time), label)
                     for time, angle, z, label in turns(4.0, samples=2000)])
    outcome = threadpitch("analyze", log, *COLUMNS, "--crossing", "edges", "--start-angle", "0", "90")
    found = json.loads(threadpitch("analyze", log, *COLUMNS, "--crossing", "edges", "--json").out)["groups"][0]
    assert "| theta_S1 |    u | theta_S2 |    u |" in outcome.out
    second = next(line for line in outcome.out.splitlines() if "|       2 |" in line).split("|")
    assert float(second[4]) == round(1e3 * found["uncertainty_mm"][0][1], 2) > 0.0


def test_logs_that_are_none(threadpitch: Command, tmp_path: Path, write_log: WriteLog) -> None:
    write_log(turns(), name="machine.csv")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "binary.csv").write_bytes(bytes(100))
    (tmp_path / "cut.csv.gz").write_bytes(gzip.compress(b"angle,z\n" * 1000)[:30])
    for name, message in [("machin.csv", "there is no such file; nearest are 'machine.csv'"),
                          ("empty.csv", "the file is empty; give a log with a header and rows"),
                          ("binary.csv", "is not a text file"), ("cut.csv.gz", "the compressed file ends too early"),
                          (".", "is a directory; give the log file in it")]:
        outcome = threadpitch("analyze", tmp_path / name, *COLUMNS)
        assert (outcome.status, outcome.out) == (2, "")
        assert_one_line(outcome.err, message)


def test_control_characters_of_a_file_do_not_reach_the_terminal(threadpitch: Command, write_log: WriteLog) -> None:
    outcome = threadpitch("analyze", write_log(turns(label="\x1b[31m")), *COLUMNS)
    assert outcome.status == 0
    assert "Group ?[31m" in outcome.out
    outcome = threadpitch("analyze", "\x1b[31mlog.csv", *COLUMNS)
    assert_one_line(outcome.err, r"\?\[31mlog\.csv: there is no such file")
