"""How far a log is read: its share is told, and shown on a terminal where reading takes its time."""

from __future__ import annotations

import gzip
import io
import os
import re
import subprocess
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest

from tests.test_cli_process import POSIX, process, read_until, terminal
from tests.test_log_formats import TEXTS, TIME, WRITERS
from threadpitch.cli import printing
from threadpitch.pitch import pitch_tables, stream_pitches
from threadpitch.trace import ColumnChoice, Signals, array_files, text_rows

LONGEST_WAIT = 60.0  # s, for a process on a busy machine
LOG = TEXTS["comments"]


def shares_of(path: Path) -> list[float]:
    """What is told while a log is streamed."""
    shares: list[float] = []
    stream_pitches(path, ColumnChoice(), read=shares.append)
    return shares


def assert_all_is_read(shares: list[float]) -> None:
    assert len(shares) > 4
    assert all(0.0 < one <= other for one, other in pairwise(shares))
    assert shares[0] < 0.5
    assert shares[-1] == 1.0


@pytest.mark.parametrize("name", [name for name in WRITERS if not name.endswith(".mat")])
def test_the_share_of_every_format_rises_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                    name: str) -> None:
    monkeypatch.setattr(array_files, "CHUNK", 100)
    WRITERS[name](tmp_path / name)
    assert_all_is_read(shares_of(tmp_path / name))


def test_a_mat_file_is_read_at_once(tmp_path: Path) -> None:
    WRITERS["log.mat"](tmp_path / "log.mat")
    assert set(shares_of(tmp_path / "log.mat")) == {1.0}


@pytest.mark.parametrize("packed", [False, True])
def test_the_share_of_a_text_is_that_of_its_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                  packed: bool) -> None:
    monkeypatch.setattr(text_rows, "BLOCK", 4096)
    monkeypatch.setattr(text_rows, "_LOOKED_AT", 4096)
    path = tmp_path / "log.csv"
    path.write_bytes(gzip.compress(LOG.encode(), compresslevel=1) if packed else LOG.encode())
    assert_all_is_read(shares_of(path))


def test_samples_and_share_are_told_of_a_log_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(LOG, encoding="utf-8")
    samples: list[int] = []
    shares: list[float] = []
    tables = pitch_tables(path, ColumnChoice(), told=samples.append, read=shares.append)
    assert sum(samples) == sum(one.trace.angle.size for one in tables) < TIME.size
    assert shares[-1] == 1.0


@POSIX
def test_of_a_pipe_no_share_is_known(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=(LOG,))
    writer.start()
    try:
        assert shares_of(path) == []
    finally:
        writer.join()


class Screen(io.StringIO):
    """A terminal that keeps what is written."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("columns", [100, 60])
def test_bar_share_samples_and_time_fit_into_a_line(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr(printing, "_SOON", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(columns))
    with printing.ReadingLine("reading") as line:
        for tenth in range(1, 10):
            line.told(12_345_678)
            line.read(0.1 * tenth)
            time.sleep(0.002)  # the time that remains is told by the speed
        line.told(1)
        line._line.refresh()
    shown = re.split(r"[\r\n]+", re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue()))
    last = [one for one in shown if "reading" in one][-1]
    assert re.fullmatch(r"reading ━+╺?━+ {2}90% 111,111,103 samples 00:0\d", last), last
    assert len(last) <= columns


@POSIX
def test_a_slow_pipe_shows_a_count_on_a_terminal() -> None:
    with terminal(columns=60) as (ours, theirs), process("analyze", "-", stdin=subprocess.PIPE,
                                                         stdout=subprocess.PIPE, stderr=theirs) as running:
        os.close(theirs)
        assert running.stdin is not None
        running.stdin.write(LOG.encode())
        running.stdin.flush()
        shown = read_until(ours, b"samples")
        running.stdin.close()
        shown += read_until(ours, b"no such mark")
        assert running.stdout is not None
        assert b"Group 2" in running.stdout.read()
        assert running.wait(LONGEST_WAIT) == 0
    assert b"reading" in shown
    assert b"%" not in shown


def test_what_is_read_soon_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setattr(printing, "_SOON", LONGEST_WAIT)
    monkeypatch.setenv("TERM", "xterm")
    with printing.ReadingLine("reading") as line:
        line.told(1000)
        line.read(1.0)
    assert screen.getvalue() == ""
    assert not line._waiting.is_alive()


def test_a_log_that_is_read_twice_is_half_read_after_the_first_time(tmp_path: Path,
                                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(array_files, "CHUNK", 100)
    WRITERS["log.parquet"](tmp_path / "log.parquet")
    shares: list[float] = []
    stream_pitches(tmp_path / "log.parquet", ColumnChoice(), signals=Signals(synchronous=True), read=shares.append)
    assert_all_is_read(shares)
    assert 0.5 in shares
