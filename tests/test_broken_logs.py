"""Sixty broken logs: one clear line each, exit status 2; bytes at random: no traceback, no hang, bounded memory."""

from __future__ import annotations

import gc
import gzip
import resource
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import stream_pitches
from threadpitch.trace import ColumnChoice

HEADER = "time_s,revs,z_mm,pass"


def good(turns: int = 4, separator: str = ",") -> list[str]:
    return [separator.join((f"{k / 1000:.3f}", f"{k / 10:.4f}", f"{0.15 * k:.5f}", "1")) for k in range(10 * turns + 1)]


def log(*, head: str = HEADER, at: int = 8, row: str | None = None, rows: list[str] | None = None) -> bytes:
    """A log with one row changed: line ``at``, from 1."""
    lines = [head, *(good() if rows is None else rows)]
    if row is not None:
        lines[at - 1] = row
    return ("\n".join(lines) + "\n").encode()


def changed(column: int, change: Callable[[float], float]) -> bytes:
    """A log with one column changed in all rows."""
    rows = [line.split(",") for line in good()]
    for fields in rows:
        fields[column] = repr(change(float(fields[column])))
    return log(rows=[",".join(fields) for fields in rows])


PACKED = gzip.compress(log(rows=good(3000)))
PARQUET = b"PAR1" + bytes(range(256)) * 4 + b"PAR1"
BROKEN: dict[str, tuple[bytes, str]] = {
    # the file
    "empty.csv": (b"", "the file is empty"),
    "blank.csv": (b"\n\n  \n\n", "the file is empty"),
    "newline.csv": (b"\n", "the file is empty"),
    "comments.csv": (b"# one\n# two\n", "there are only comments"),
    "header only.csv": (HEADER.encode(), "there are no rows below the header"),
    "header and blanks.csv": (HEADER.encode() + b"\n\n\n", "there are no rows below the header"),
    "binary.csv": (bytes(range(256)) * 40, "is not a text file"),
    "zeros.csv": (b"\0" * 5000, "is not a text file"),
    "open quote over a long log.csv": (log(row='"0.006,0.6,0.9,1', rows=good(9000)), ":8: a quoted text is not closed"),
    "late zero.csv": (log(rows=good(4000)) + b"\0\0", "a zero byte in the text"),
    "picture.png": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + b"\0" * 90, "is not a text file"),
    "gigantic line.csv": (HEADER.encode() + b"\n" + b"1" * 3_000_000, "a line of more than 65536 characters"),
    "gigantic header.csv": (b"a," * 500_000, "a line of more than 65536 characters"),
    "names with blanks.txt": (log(head="time revs z mm pass of all", rows=good(separator="  ")),
                              "4 fields where the header has 7"),
    "truncated.csv.gz": (PACKED[: len(PACKED) // 2], "the compressed file ends too early"),
    "head of gz.csv.gz": (PACKED[:6], "the compressed file ends too early"),
    "damaged.csv.gz": (PACKED[:3000] + b"\xff" * 40 + PACKED[3040:], "the compressed file is damaged"),
    "wrong sum.csv.gz": (PACKED[:-8] + b"\1\2\3\4" + PACKED[-4:], "the compressed file is damaged"),
    "zlib.csv": (zlib.compress(log()), "no column|is not a text file|line of more than|no rows|first row"),
    "cut.parquet": (PARQUET[:300], "the Parquet file is cut off: its end is missing after 300 bytes"),
    "false.parquet": (PARQUET, "cannot be read as Parquet"),
    "cut.h5": (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "cannot be read as HDF5"),
    "cut.mat": (b"MATLAB 5.0 MAT-file" + b" " * 30, "the MAT file is cut off: its end is missing after 49 b"),
    "cut.tdms": (b"TDSm" + b"\xff" * 60, "cannot be read as TDMS|there is no column of numbers"),
    "cut.mf4": (b"MDF     4.10    " + b"\xff" * 90, "cannot be read as MDF"),
    # the header
    "no header.csv": ("\n".join(good()).encode(), "the first row holds numbers; give a header"),
    "other names.csv": (log(head="a,b,c,d"), "no column is called like the angle; choose one with --angle"),
    "two angles.csv": (log(head="time_s,spindle_revs,spindle_revs,z_mm"), "may be column .* or .*; choose with"),
    "no position.csv": (log(head="time_s,revs,x,pass"), "no column is called like the position"),
    "short header.csv": (log(head="time_s,revs,z_mm"), ":2: 4 fields where the header has 3"),
    "long header.csv": (log(head=HEADER + ",load,torque"), ":2: 4 fields where the header has 6"),
    "quoted header.csv": (log(head='time_s,"revs,z_mm,pass'), "4 fields where|no column is called|quoted"),
    "two headers.csv": (log(row=HEADER), ":8: column 'pass' .*|:8: column '.*' holds '.*', not a number"),
    "counts.csv": (log(head="time_s,spindle_counts,z_mm,pass"), "is counts; give the counts per turn"),
    # the rows
    "mixed separators.csv": (log(row="0.006;0.6;0.9;1"), ":8: 1 fields where the header has 4"),
    "short row.csv": (log(row="0.006,0.6"), ":8: 2 fields where the header has 4"),
    "long row.csv": (log(row="0.006,0.6,0.9,1,7,8"), ":8: 6 fields where the header has 4"),
    "cut in the last row.csv": (log()[:-8], ":42: [123] fields where the header has 4"),
    "open quote.csv": (log(row='0.006,"0.6,0.9,1'), ":8: a quoted text is not closed"),
    "text.csv": (log(row="0.006,oops,0.9,1"), ":8: column 'revs' holds 'oops', not a number"),
    "units in rows.csv": (log(row="0.006,0.6 rev,0.9,1"), ":8: column 'revs' holds '0.6 rev', not a number"),
    "underscore.csv": (log(row="0.006,0_6,0.9,1"), ":8: column 'revs' holds '0_6', not a number"),
    "hexadecimal.csv": (log(row="0.006,0x6,0.9,1"), ":8: column 'revs' holds '0x6', not a number"),
    "empty field.csv": (log(row="0.006,,0.9,1"), ":8: column 'revs' is empty"),
    "empty position.csv": (log(row="0.006,0.6, ,1"), ":8: column 'z_mm' is empty"),
    "error text.csv": (log(row="0.006,#N/A,0.9,1"), ":8: column 'revs' holds '#N/A', not a number"),
    "thousands.csv": (log(row='0.006,"1,000.0",0.9,1'), ":8: column 'revs' holds '1,000.0', not a number"),
    "decimal comma.csv": (log(row='0.006,"0,6",0.9,1'), ":8: .*write the decimal sign as a point"),
    "escape.csv": (log(row="0.006,\x1b[31m,0.9,1"), r":8: column 'revs' holds '\\x1b\[31m'"),
    "nan.csv": (log(row="0.006,nan,0.9,1"), ":8: angle is NaN"),
    "nan position.csv": (log(row="0.006,0.6,NaN,1"), ":8: position is NaN"),
    "infinite.csv": (log(row="0.006,inf,0.9,1"), ":8: angle is inf"),
    "minus infinite.csv": (log(row="0.006,0.6,-inf,1"), ":8: position is -inf"),
    "overflow.csv": (log(row="0.006,1e400,0.9,1"), ":8: angle is inf"),
    "huge position.csv": (log(row="0.006,0.6,1e200,1"), ":8: position is"),
    # what was recorded
    "reversed time.csv": (log(row="0.001,0.6,0.9,1"), ":8: time runs back from 0.005 to 0.001 s"),
    "time from the end.csv": (changed(0, lambda time: 9.0 - time), ":3: time runs back"),
    "nan time.csv": (log(row="nan,0.6,0.9,1"), ":8: time is not finite"),
    "constant angle.csv": (changed(1, lambda _: 3.0), "the spindle turns 0 of a turn"),
    "half a turn.csv": (changed(1, lambda angle: 0.1 * angle), "the spindle turns 0.4 of a turn"),
    "degrees as turns.csv": (changed(1, lambda angle: 360.0 * angle), "turns in 41 samples; is the unit of the angle"),
    "reversal.csv": (changed(1, lambda angle: min(angle, 5.0 - angle)), "the spindle turns back|of a turn"),
    "jump back.csv": (log(at=30, row="0.028,0.1,4.2,1"), ":30: the spindle turns back from 2.7000 to 0.1000 turns"),
    "huge gap.csv": (log(at=30, row="0.028,1e12,4.2,1"), "turns in|turns back"),
    "not threading.csv": (log().replace(b",1\n", b",0\n"), "no row is threading: column 'pass'"),
    "one row.csv": (log(rows=good()[:1]), "1 samples; a pitch needs two"),
    "one row in a pass.csv": (log(at=42, row="0.040,4.0,6.0,2"), "group '2': 1 samples; a pitch needs two"),
}


def test_there_are_sixty_of_them() -> None:
    assert len(BROKEN) >= 60


@pytest.fixture(scope="module")
def only_new_objects_are_collected() -> Iterator[None]:
    """So that ``gc.collect`` after each log takes no time; what a log leaves open warns all the same."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.usefixtures("only_new_objects_are_collected")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # asammdf leaves its scratch file open
@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_log_is_refused_in_one_line(tmp_path: Path, threadpitch: Command, name: str) -> None:
    content, message = BROKEN[name]
    (tmp_path / name).write_bytes(content)
    outcome = threadpitch("analyze", tmp_path / name)
    assert (outcome.status, outcome.out) == (2, "")
    assert_one_line(outcome.err, message)
    gc.collect()


def test_folders_and_missing_files_are_refused(tmp_path: Path, threadpitch: Command) -> None:
    (tmp_path / "logs.csv").mkdir()
    assert_one_line(threadpitch("analyze", tmp_path / "logs.csv").err, "is a directory; give the log file in it")
    assert_one_line(threadpitch("analyze", tmp_path / "log.csv").err, "there is no such file; nearest are 'logs.csv'")


SEEDS = [log(), log(head="time;revs;z_mm;pass", rows=good(separator=";")), gzip.compress(log()), PARQUET,
         b"# time revs z_mm pass\n" + "\n".join(good(separator=" ")).encode(), b"\x89HDF\r\n\x1a\n" + b"\0" * 600,
         b"Name\tx\nSymbolName\ta\tSymbolName\tb\nName\trevs\tName\tz\n" + b"0\t1\t0\t2\n" * 9]
SNIPPETS = [b"\n", b",", b";", b'"', b"1e308", b"-", b"nan", b" ", b"#", b"\r"]


@settings(deadline=None, max_examples=400, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_bytes_give_pitches_or_one_line(tmp_path: Path, data: st.DataObject) -> None:
    content = bytearray(data.draw(st.sampled_from(SEEDS) | st.binary(max_size=3000)))
    for _ in range(data.draw(st.integers(0, 6))):
        place = data.draw(st.integers(0, len(content)))
        content[place : place + data.draw(st.integers(0, 30))] = data.draw(
            st.binary(max_size=12) | st.sampled_from(SNIPPETS))
    (tmp_path / "log").write_bytes(bytes(content))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        stream_pitches(tmp_path / "log", ColumnChoice())
    except ValueError as error:
        assert str(error).isprintable()  # noqa: PT017 -- either outcome is right, and both are checked
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000  # KiB
