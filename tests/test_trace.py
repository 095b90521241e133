"""Traces and the reader of CSV logs: what is accepted, what is refused, and with which words."""

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from threadpitch.pitch import pitch_tables
from threadpitch.trace import REVERSAL_LIMIT, TURN, ColumnChoice, FloatArray, Trace, TraceError, read_groups

CHOICE = ColumnChoice("revs", "z_mm", group="pass")
HEADER = "time_s,revs,z_mm,pass"


def rows(turns: float = 3.0, label: str = "1", sign: int = 1, start: float = 0.0) -> list[str]:
    """One group: ten samples per turn, 1.5 mm per turn, one sample per millisecond."""
    return [f"{start + k / 1000:.3f},{sign * k / 10:.4f},{0.15 * k:.5f},{label}" for k in range(round(10 * turns) + 1)]


def write(folder: Path, lines: list[str], name: str = "log.csv") -> Path:
    path = folder / name
    text = "\n".join(lines) + "\n"
    if name.endswith(".gz"):
        path.write_bytes(gzip.compress(text.encode()))
    else:
        path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_groups_come_in_the_order_of_the_file_with_their_lines(tmp_path: Path, name: str) -> None:
    idle = ["0.5,7.7,3.3,0", "0.6,,,", "0.7,nan,text,false"]
    path = write(tmp_path, [HEADER, *idle, *rows(label="b"), *idle, *rows(label="1.0"), *rows(label="b")], name)
    traces = read_groups(path, CHOICE)
    assert [trace.name for trace in traces] == ["b", "1", "b (2)"]
    first = traces[0]
    assert first.angle[10] == TURN
    np.testing.assert_allclose(first.position, 1.5e-3 * first.angle / TURN, atol=1e-18)
    assert first.time is not None
    assert first.time[-1] == 0.03
    assert first.lines is not None
    assert first.lines[[0, -1]].tolist() == [5, 35]
    assert first.source == str(path)
    assert [trace.angle.size for trace in traces] == [31, 31, 31]


@pytest.mark.parametrize("idle", ["0", "0.0", "-0", "", " ", "false", "False", "FALSE", "nan"])
def test_rows_that_are_not_threading_are_left_out(tmp_path: Path, idle: str) -> None:
    path = write(tmp_path, [HEADER, f"9,9,9,{idle}", *rows(label="true"), f"0,0,0,{idle}"])
    (trace,) = read_groups(path, CHOICE)
    assert (trace.name, trace.angle.size) == ("true", 31)


def test_a_flag_that_is_true_in_every_pass_makes_a_group_of_each(tmp_path: Path) -> None:
    idle = "0,0,0,false"
    path = write(tmp_path, [HEADER, idle, *rows(label="true"), idle, *rows(4.0, label="true"), idle])
    groups = pitch_tables(path, CHOICE)
    assert [(group.label, group.table.pitch.shape[1]) for group in groups] == [("true", 3), ("true (2)", 4)]


def test_without_group_column_the_whole_file_is_group_1(tmp_path: Path) -> None:
    (trace,) = read_groups(write(tmp_path, [HEADER, *rows(label="0")]), ColumnChoice("revs", "z_mm"))
    assert (trace.name, trace.angle.size) == ("1", 31)


def test_groups_that_stand_in_several_blocks_of_the_file_are_whole(tmp_path: Path) -> None:
    many = rows(3000.0)  # more than one block of characters
    path = write(tmp_path, [HEADER, *many, *many])
    with pytest.raises(TraceError, match=rf"log\.csv:{len(many) + 2}: time runs back from 30 to 0 s"):
        read_groups(path, CHOICE)
    (trace,) = read_groups(write(tmp_path, [HEADER, *many]), CHOICE)
    assert trace.angle.size == 30001
    assert trace.lines is not None
    assert (np.diff(trace.lines) == 1).all()


@pytest.mark.parametrize(("unit", "per_turn"), [("rev", 1.0), ("deg", 360.0), ("rad", TURN), ("count", 4096.0)])
def test_units_of_the_angle(tmp_path: Path, unit: str, per_turn: float) -> None:
    lines = [f"{k * per_turn / 8!r},{0.5 * k}" for k in range(33)]
    choice = ColumnChoice("theta", "z", unit, "um", counts_per_turn=4096.0 if unit == "count" else None)
    (group,) = pitch_tables(write(tmp_path, ["theta,z", *lines]), choice)
    np.testing.assert_allclose(group.table.pitch, 4e-6, rtol=0.0, atol=1e-18)
    assert group.table.pitch.shape == (1, 4)


def test_an_angle_that_counts_down_is_turned_around_and_the_table_says_so(tmp_path: Path) -> None:
    (group,) = pitch_tables(write(tmp_path, [HEADER, *rows(sign=-1)]), CHOICE)
    np.testing.assert_allclose(group.table.pitch, 1.5e-3, atol=1e-15)
    assert "counts down: turned around" in group.table.notes[0]


@pytest.mark.parametrize("lines", [
    ["\ufeff" + HEADER, *rows()],
    ["", HEADER, "", *rows(), "", ""],
    [HEADER.replace(",", ";"), *(row.replace(",", ";") for row in rows())],
    [HEADER.replace(",", "\t"), *(row.replace(",", "\t") for row in rows())],
    [HEADER, *(row + "," for row in rows())],
    [" time_s , revs , z_mm , pass ", *(row.replace(",", " , ") for row in rows())],
    ['"time_s","revs","z_mm","pass"', *('"' + row.replace(",", '","') + '"' for row in rows())],
    [HEADER + "\r", *(row + "\r" for row in rows())],
    ["date;" + HEADER.replace(",", ";"), *("2024-05-01;" + row.replace(",", ";") for row in rows())],
    [HEADER.replace("time_s", "time"), *("12:00:00" + row[5:] for row in rows())],
], ids=["byte order mark", "blank lines", "semicolons", "tabs", "separator at the end", "spaces", "quotes", "CRLF",
        "text column", "time of day"])
def test_shapes_of_csv_that_machines_write(tmp_path: Path, lines: list[str]) -> None:
    (trace,) = read_groups(write(tmp_path, lines), CHOICE)
    np.testing.assert_array_equal(trace.angle, TURN * np.round(np.arange(31) / 10, 4))


def test_a_header_in_the_code_page_of_windows_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes("\n".join(["Winkel [°],z", "0,0", "1,1", "2,2"]).encode("cp1252"))
    (trace,) = read_groups(path, ColumnChoice("Winkel [°]", "z"))
    assert trace.angle.size == 3


def changed(line: int, text: str) -> list[str]:
    lines = [HEADER, *rows()]
    lines[line - 1] = text
    return lines


@pytest.mark.parametrize(("lines", "message"), [
    (changed(7, "0.005,nan,0.9,1"), r":7: angle is NaN"),
    (changed(7, "0.005,0.5,nan,1"), r":7: position is NaN"),
    (changed(7, "0.005,inf,0.9,1"), r":7: angle is inf"),
    (changed(7, "0.005,0.5,-inf,1"), r":7: position is -inf"),
    (changed(7, "nan,0.5,0.9,1"), r":7: time is not finite"),
    (changed(7, "0.005,0.5,oops,1"), r":7: column 'z_mm' holds 'oops', not a number"),
    (changed(7, "0.005,0.5,,1"), r":7: column 'z_mm' is empty"),
    (changed(7, '0.005,0.5,"0,9",1'), r":7: column 'z_mm' holds '0,9', .*write the decimal sign as a point"),
    (changed(7, "0.005,0.5,0,9,1"), r":7: 5 fields where the header has 4"),
    (changed(7, "0.005,0.5"), r":7: 2 fields where the header has 4"),
    (changed(7, '0.005,"0.5,0.9,1'), r":7: .*quoted text is not closed"),
    (changed(7, "0.005,0.5,\x1b[31m,1"), r":7: column 'z_mm' holds '\\x1b\[31m'"),
    (changed(7, "0.0041,0.1,0.9,1"), r":7: the spindle turns back from 0\.4000 to 0\.1000 turns"),
    (changed(7, "0.001,0.5,0.9,1"), r":7: time runs back from 0\.004 to 0\.001 s"),
    (changed(1, "time_s,turns,z_mm,pass"), r":1: there is no column 'revs'; nearest are"),
    (changed(1, "time_s,revs,z_m,pass"), r":1: there is no column 'z_mm'; nearest are 'z_m'"),
    (changed(1, "time_s,revs,z_mm,Pass"), r":1: there is no column 'pass'; nearest are 'Pass'"),
    (changed(1, "revs,revs,z_mm,pass"), r":1: column 'revs' is there 2 times"),
    (changed(1, "0,0,0,0"), r":1: the first row holds numbers; give a header"),
    ([HEADER, *rows(label="0")], r"no row is threading: column 'pass'"),
    ([HEADER], r"there are no rows below the header"),
    ([""], r"the file is empty"),
    ([HEADER, *("x" * 70000 for _ in range(3))], r":2: a line of more than 65536 characters"),
    (["revs,z_mm,pass", *(f"{1e9 * k},{k},1" for k in range(9))], r"turns in 9 samples; is the unit"),
    (changed(7, "0.005,1e308,0.9,1"), r":7: angle is inf"),
    (changed(7, "0.005,0.5,1e308,1"), r":7: position is 1e\+305"),
    ([HEADER, *rows(0.5)], r"group '1': the spindle turns 0\.5 of a turn"),
    ([HEADER, *rows(), "9,9,9,2"], r"group '2': 1 samples; a pitch needs two"),
])
def test_a_log_that_cannot_be_used_says_where_and_why(tmp_path: Path, lines: list[str], message: str) -> None:
    path = write(tmp_path, lines)
    with pytest.raises(ValueError, match=message) as caught:
        pitch_tables(path, CHOICE)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_no_logs_are_refused(tmp_path: Path) -> None:
    packed = write(tmp_path, [HEADER, *rows(3000.0)], "whole.csv.gz").read_bytes()
    files = {
        "cut.csv.gz": (packed[: len(packed) // 2], "compressed file ends too early"),
        "bent.csv.gz": (packed[:2000] + b"\xff" * 50 + packed[2050:], "compressed file is damaged"),
        "head.csv.gz": (packed[:5], "compressed file ends too early"),
        "binary.csv": (bytes(range(256)) * 9, "not a text file"),
        "late.csv": (HEADER.encode() + b"\n" + b"0,0,0,1\n" * 9000 + b"0,\0,0,1\n", r":9002: a zero byte"),
        "empty.csv": (b"", "the file is empty"),
    }
    for name, (content, message) in files.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(TraceError, match=message):
            read_groups(tmp_path / name, CHOICE)
    with pytest.raises(TraceError, match="is a directory"):
        read_groups(tmp_path, CHOICE)
    with pytest.raises(TraceError, match=r"there is no such file; nearest are 'empty\.csv'"):
        read_groups(tmp_path / "emty.csv", CHOICE)
    with pytest.raises(TraceError, match="there is no such file"):
        read_groups(tmp_path / "no" / "folder.csv", CHOICE)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_bytes_give_a_table_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray("\n".join([HEADER, *rows()]).encode())
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content)))
        content[place : place + data.draw(st.integers(0, 30))] = data.draw(st.binary(max_size=12))
    path = tmp_path / "log.csv"
    path.write_bytes(bytes(content))
    try:
        groups = pitch_tables(path, CHOICE)
    except ValueError as error:
        assert str(error).isprintable()  # noqa: PT017 # either outcome is right, and both are checked
    else:
        assert all(np.isfinite(group.trace.angle).all() for group in groups)


def test_choices_that_make_no_sense_are_refused() -> None:
    with pytest.raises(TraceError, match="needs the counts per turn"):
        ColumnChoice("a", "b", "count")
    with pytest.raises(TraceError, match="counts per turn is 0; give a positive number"):
        ColumnChoice("a", "b", "count", counts_per_turn=0)
    with pytest.raises(TraceError, match="'mm' is not a unit of the angle"):
        ColumnChoice("a", "b", "mm")
    with pytest.raises(TraceError, match="'furlong' is not a unit of the position"):
        ColumnChoice("a", "b", position_unit="furlong")


def swaying(back: float) -> FloatArray:
    """An angle that goes back by so much in its middle."""
    angle: FloatArray = np.linspace(0.0, 4.0 * TURN, 400)
    angle[200:] -= back + angle[200] - angle[199]
    return angle


def evenly(size: int) -> FloatArray:
    """A feed without events."""
    position: FloatArray = np.linspace(0.0, 1.0, size)
    return position


def test_a_reversal_begins_at_its_limit() -> None:
    position = evenly(400)
    assert not Trace(swaying(0.99 * REVERSAL_LIMIT), position).rising
    with pytest.raises(TraceError, match="sample 200: the spindle turns back"):
        Trace(swaying(1.01 * REVERSAL_LIMIT), position)


def test_the_limit_of_an_encoder_is_a_count_and_a_half_at_least_a_degree() -> None:
    position = evenly(400)
    coarse = math.radians(10.0)
    assert not Trace(swaying(coarse), position, resolution=coarse).rising
    with pytest.raises(TraceError, match="turns back"):
        Trace(swaying(2.0 * coarse), position, resolution=coarse)
    with pytest.raises(TraceError, match="turns back"):
        Trace(swaying(math.radians(1.1)), position, resolution=TURN / 4096)


def test_a_slow_reversal_is_found_though_every_step_is_small() -> None:
    angle = np.concatenate((np.linspace(0.0, 20.0, 2000), np.linspace(20.0, 19.0, 2000)))
    with pytest.raises(TraceError, match=r"turns back from 3\.1831"):
        Trace(angle, np.arange(4000.0))


@pytest.mark.parametrize("size", [400, 3_000_000])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_no_sample_goes_unchecked(size: int, share: float, value: float) -> None:
    sample = round(share * (size - 1))
    angle, position = 1e3 * evenly(size), evenly(size)
    angle[sample] = value
    with pytest.raises(TraceError, match=f"sample {sample}: angle is"):
        Trace(angle, position)
    angle[sample], position[sample] = 1e3 * position[sample], value
    with pytest.raises(TraceError, match=f"sample {sample}: position is"):
        Trace(angle, position)


def test_arrays_of_other_shapes_are_refused() -> None:
    ones: FloatArray = np.ones(5)
    with pytest.raises(TraceError, match="position has 4 samples and angle 5"):
        Trace(ones, ones[:4])
    with pytest.raises(TraceError, match=r"angle has the shape \(5, 1\)"):
        Trace(ones.reshape(5, 1), ones)
    with pytest.raises(TraceError, match="1 samples"):
        Trace(ones[:1], ones[:1])
    with pytest.raises(TraceError, match="time has 3 samples"):
        Trace(ones, ones, ones[:3])
    with pytest.raises(TraceError, match="angle is not an array of numbers"):
        Trace(np.array(["a", "b"]), ones[:2])


def test_whole_numbers_and_strided_arrays_are_taken() -> None:
    both = np.arange(20).reshape(10, 2)
    trace = Trace(both[:, 0], both[:, 1])  # type: ignore[arg-type] # counts come as integers
    assert trace.angle.dtype == np.float64
    assert trace.angle.tolist() == list(range(0, 20, 2))


def test_an_angle_that_counts_down_is_refused_with_the_mend() -> None:
    with pytest.raises(TraceError, match="counts down; give it counted up"):
        Trace(-np.arange(9.0), np.arange(9.0))


def test_a_group_called_1_0_is_not_group_10(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("revs,z_mm,pass\n" + "".join(f"{k / 10},{k},{'10' if k < 30 else '1_0'}\n" for k in range(60)))
    assert [trace.name for trace in read_groups(path, ColumnChoice())] == ["10", "1_0"]
