"""``threadpitch watch``: every P(n) before the next sample comes, and a clean end."""

from __future__ import annotations

import gzip
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Command, assert_one_line
from threadpitch.pitch import stream_pitches
from threadpitch.trace import ColumnChoice

WAIT = 60.0  # s, for a process on a busy machine
SAMPLES_PER_TURN = 20
HEADER = "time_s,revs,z_mm,pass"


def row(sample: int) -> str:
    revs = sample / SAMPLES_PER_TURN
    return f"{0.001 * sample:.3f},{revs % 1.0:.4f},{1.5 * revs + (0.001 if sample > 70 else 0.0):.6f},1"


def start(*arguments: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "threadpitch", "watch", *arguments], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.fixture
def watching() -> Iterator[subprocess.Popen[bytes]]:
    with start("-", "--json", "--start-angle", "0", "180") as process:
        yield process
        process.kill()


def send(process: subprocess.Popen[bytes], *lines: str) -> None:
    assert process.stdin is not None
    process.stdin.write("".join(f"{line}\n" for line in lines).encode())
    process.stdin.flush()


def received(process: subprocess.Popen[bytes], within: float = WAIT) -> dict[str, float] | None:
    assert process.stdout is not None
    if not select.select([process.stdout], [], [], within)[0]:
        return None
    return dict(json.loads(process.stdout.readline()))


def test_a_pitch_is_there_before_the_next_sample(watching: subprocess.Popen[bytes]) -> None:
    send(watching, HEADER, *(row(sample) for sample in range(SAMPLES_PER_TURN + 1)))
    first = received(watching)
    assert first is not None
    assert (first["turn"], first["start_angle_deg"]) == (1, 0.0)
    assert first["pitch_mm"] == pytest.approx(1.5)
    found = first
    for sample in range(SAMPLES_PER_TURN + 1, 5 * SAMPLES_PER_TURN + 1):
        send(watching, row(sample))
        half_turns, beyond = divmod(sample, SAMPLES_PER_TURN // 2)
        if beyond == 0:
            told = received(watching)
            assert told is not None, f"nothing after sample {sample}"
            assert (told["turn"], told["start_angle_deg"]) == (half_turns // 2, 180.0 * (half_turns % 2))
            found = told
    assert watching.stdin is not None
    watching.stdin.close()
    assert watching.wait(WAIT) == 0
    assert found["max_mm"] == pytest.approx(1.501)
    assert found["min_mm"] == pytest.approx(1.5)


def test_no_turn_is_told_that_is_not_complete(watching: subprocess.Popen[bytes]) -> None:
    send(watching, HEADER, *(row(sample) for sample in range(SAMPLES_PER_TURN + 1)))
    assert received(watching) is not None
    send(watching, *(row(sample) for sample in range(SAMPLES_PER_TURN + 1, SAMPLES_PER_TURN + 10)))
    assert received(watching, 0.3) is None


def test_ctrl_c_ends_cleanly(watching: subprocess.Popen[bytes]) -> None:
    send(watching, HEADER, *(row(sample) for sample in range(2 * SAMPLES_PER_TURN)))
    assert received(watching) is not None
    watching.send_signal(signal.SIGINT)
    assert watching.wait(WAIT) == 0
    assert watching.stderr is not None
    assert watching.stderr.read() == b""


def test_a_reader_that_goes_away_ends_it_without_a_word(watching: subprocess.Popen[bytes]) -> None:
    send(watching, HEADER, *(row(sample) for sample in range(2 * SAMPLES_PER_TURN)))
    assert received(watching) is not None
    assert watching.stdout is not None
    watching.stdout.close()
    send(watching, *(row(sample) for sample in range(2 * SAMPLES_PER_TURN, 9 * SAMPLES_PER_TURN)))
    assert watching.wait(WAIT) == 1
    assert watching.stderr is not None
    assert watching.stderr.read() == b""


def test_a_damaged_row_is_named(watching: subprocess.Popen[bytes]) -> None:
    send(watching, HEADER, *(row(sample) for sample in range(30)), "0.030,text,2.25,1")
    assert watching.stdin is not None
    watching.stdin.close()
    assert watching.wait(WAIT) == 2
    assert watching.stderr is not None
    assert watching.stderr.read().decode().strip() == (
        "threadpitch: -:32: column 'revs' holds 'text', not a number; mend this row")


def test_a_growing_file_gives_the_pitches_of_the_finished_one(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = [HEADER, *(row(sample) for sample in range(12 * SAMPLES_PER_TURN + 1))]
    text = ("\n".join(lines) + "\n").encode()
    with path.open("wb") as file, start(str(path), "--json", "--idle", "1") as process:
        for first in range(0, len(text), 997):
            file.write(text[first : first + 997])
            file.flush()
            os.fsync(file.fileno())
            time.sleep(0.02)
        out, err = process.communicate(timeout=WAIT)
    assert (process.returncode, err) == (0, b"")
    found = [json.loads(line)["pitch_mm"] for line in out.splitlines()]
    (whole,) = stream_pitches(path, ColumnChoice())
    assert found == [1e3 * value for value in whole.table.pitch[0].tolist()]


def test_a_time_without_growth_is_not_negative(threadpitch: Command) -> None:
    outcome = threadpitch("watch", "log.csv", "--idle", "-1")
    assert outcome.status == 2
    assert_one_line(outcome.err, "--idle is -1 s; give 0 or more")


def test_a_packed_file_cannot_be_watched(tmp_path: Path, threadpitch: Command) -> None:
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(HEADER.encode() + b"\n" * 3))
    outcome = threadpitch("watch", tmp_path / "log.csv.gz", "--idle", "0.1")
    assert outcome.status == 2
    assert_one_line(outcome.err, "is packed by gzip, which cannot be read while it is written")


@pytest.mark.parametrize(("damage", "said"), [("0,\0,0,1", "a zero byte"), ("1" * 70000, "a line of more than")])
def test_a_line_that_is_no_row_is_named_wherever_it_stands(tmp_path: Path, threadpitch: Command, damage: str,
                                                           said: str) -> None:
    log = tmp_path / "log.csv"
    log.write_text("\n".join([HEADER, *map(row, range(100)), damage, *map(row, range(101, 300)), ""]))
    status, _, error = threadpitch("watch", str(log), "--idle", "0.1")
    assert status == 2
    assert_one_line(error, f":102: {said}")
