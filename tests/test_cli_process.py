"""The command line as a process of its own: Ctrl-C, terminals, pipes that nobody reads."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import assert_one_line
from threadpitch.run_folder import FILES

ROOT = Path(__file__).parents[1]
LOG = ROOT / "models" / "logs" / "linuxcnc" / "I_g76_ripple_400.csv.gz"
ANALYZE = ("analyze", str(LOG), "--angle", "spindle_revs_encoder", "--position", "z_fb_mm", "--group", "pass")
QUICK = ("--stop-time", "0.6", "--start-angle", "0")
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals and signals of POSIX")
LONGEST_WAIT = 60.0  # s; of a process that takes two


def process(*arguments: str, **options: Any) -> subprocess.Popen[bytes]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-m", "threadpitch", *arguments], env=environment, **options)


@contextlib.contextmanager
def terminal(columns: int) -> Iterator[tuple[int, int]]:
    """(our end, the process's end) of a pseudo-terminal."""
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    try:
        yield ours, theirs
    finally:
        os.close(ours)


def read_until(end: int, mark: bytes) -> bytes:
    """What arrives at our end up to the mark, or all there is."""
    text = b""
    while mark not in text:
        try:
            part = os.read(end, 65536)
        except OSError:  # Linux: the other end was closed
            break
        if not part:
            break
        text += part
    return text


@POSIX
def test_ctrl_c_on_a_terminal_saves_what_was_recorded(workplace: Path) -> None:
    """The progress bar on standard error tells that the simulation runs."""
    with terminal(columns=80) as (ours, theirs):
        running = process("run", "--stop-time", "500", "--output", "half way", stderr=theirs, stdout=subprocess.PIPE)
        os.close(theirs)
        shown = read_until(ours, b"%")
        running.send_signal(signal.SIGINT)
        shown += read_until(ours, b"half way")
        out, _ = running.communicate(timeout=LONGEST_WAIT)
    assert (running.returncode, out) == (130, b"")
    assert b"simulating" in shown
    assert b"Traceback" not in shown
    (message,) = re.findall(rb"threadpitch: interrupted at t = (\S+) s; what was recorded is in half way", shown)
    assert {path.name for path in (workplace / "half way").iterdir()} == set(FILES)
    assert [path.name for path in workplace.iterdir()] == ["half way"]
    last = (workplace / "half way" / "trace.csv").read_text(encoding="utf-8").splitlines()[-1]
    assert float(last.split(",")[0]) == pytest.approx(float(message), abs=1e-9)


INTERRUPT_ITSELF = """
import os, signal, sys
from threadpitch import cli, lathe

simulate = lathe.simulate

def interrupted(*arguments, progress, **options):
    def told(done, steps):
        progress(done, steps)
        if done >= 50:
            os.kill(os.getpid(), signal.SIGINT)
    return simulate(*arguments, progress=told, **options)

lathe.simulate = interrupted
cli.main(sys.argv[1:])
"""


@POSIX
def test_ctrl_c_before_threading_is_one_line_and_saves_the_trace(workplace: Path) -> None:
    """Told by the progress itself, so that the instant is the same on every machine."""
    done = subprocess.run([sys.executable, "-c", INTERRUPT_ITSELF, "run", "--json", "--stop-time", "500"],
                          env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
                          timeout=LONGEST_WAIT)
    assert (done.returncode, done.stdout) == (130, "")
    assert_one_line(done.stderr, r"interrupted at t = \S+ s; what was recorded is in threadpitch-run\n")
    folder = workplace / "threadpitch-run"
    document = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    rows = (folder / "trace.csv").read_text(encoding="utf-8").splitlines()
    assert 50 <= document["steps"] == len(rows) - 2  # header, and the row after initialisation
    assert document["passes"] == []


@POSIX
def test_a_terminal_gets_lines_and_bold_heads_of_its_width() -> None:
    with terminal(columns=60) as (ours, theirs):
        environment = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "NO_COLOR")}
        running = subprocess.Popen([sys.executable, "-m", "threadpitch", *ANALYZE, "--start-angle", *"01234"],
                                   env=environment | {"PYTHONPATH": str(ROOT), "TERM": "xterm"}, stdout=theirs,
                                   stderr=subprocess.PIPE)
        os.close(theirs)
        shown = read_until(ours, b"nothing of this name").decode()
        _, err = running.communicate(timeout=LONGEST_WAIT)
    assert (running.returncode, err) == (0, b"")
    assert "\x1b[1mGroup 1\x1b[0m" in shown
    assert "─" in shown
    plain = re.sub(r"\x1b\[[0-9;]*m", "", shown).replace("\r", "")
    assert max(map(len, plain.splitlines())) <= 60


def test_a_pipe_gets_plain_text_and_no_progress(workplace: Path) -> None:
    done = process("run", *QUICK, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    out, err = done.communicate(timeout=LONGEST_WAIT)
    assert (done.returncode, err) == (0, b"")
    assert out.isascii()
    assert b"\x1b" not in out


@POSIX
@pytest.mark.parametrize("words", [ANALYZE, (*ANALYZE, "--json"), (), ("--help",), ("analyze", "-h")])
def test_a_closed_pipe_ends_it_without_a_word(words: tuple[str, ...]) -> None:
    """As ``threadpitch analyze ... | head -1`` does, when head is quick."""
    theirs, ours = os.pipe()
    os.close(theirs)
    done = process(*words, stdout=ours, stderr=subprocess.PIPE)
    os.close(ours)
    _, err = done.communicate(timeout=LONGEST_WAIT)
    assert (done.returncode, err) == (1, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a disk that is full")
def test_a_full_disk_under_standard_output_is_told_once(workplace: Path) -> None:
    with open("/dev/full", "wb") as full:
        done = process(*ANALYZE, "--json", stdout=full, stderr=subprocess.PIPE)
    _, err = done.communicate(timeout=LONGEST_WAIT)
    assert done.returncode == 2
    assert_one_line(err.decode(), "standard output cannot be written")


@POSIX
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_pipe_into_which_nobody_writes_is_left_at_once(sent: signal.Signals) -> None:
    with process("analyze", "-", stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as analyzing:
        assert analyzing.stdin is not None
        analyzing.stdin.write(b"revs,z_mm\n" + b"".join(b"%.1f,%.2f\n" % (0.1 * k, 0.15 * k) for k in range(20000)))
        analyzing.stdin.flush()  # more than a pipe holds: it reads, and waits for the rest
        analyzing.send_signal(sent)
        try:
            assert analyzing.wait(LONGEST_WAIT) == 128 + sent
        finally:
            analyzing.kill()
        assert analyzing.stderr is not None
        assert analyzing.stderr.read() == b"threadpitch: interrupted\n"


@POSIX
@pytest.mark.parametrize(("closed", "said"), [(">&-", b"standard output is closed"),
                                              ("<&-", b"standard input is closed")])
def test_a_closed_stream_is_told_in_a_line(closed: str, said: bytes) -> None:
    command = f"exec {sys.executable} -m threadpitch analyze - {closed}"
    ran = subprocess.run(["/bin/sh", "-c", command], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                         stdin=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": str(ROOT)}, timeout=LONGEST_WAIT)
    assert ran.returncode == 2
    assert said in ran.stderr
    assert ran.stderr.count(b"\n") == 1
