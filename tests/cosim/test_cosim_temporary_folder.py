"""What a killed process leaves behind is removed by the next one; what is in use, or in doubt, stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from threadpitch.cosim.temporary_folder import TemporaryFolder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="only POSIX removes what others left")
HOLD = """
import sys
from threadpitch.cosim.temporary_folder import TemporaryFolder
folder = TemporaryFolder()
(folder.path / "library.so").write_text("x")
print(folder.path, flush=True)
sys.stdin.read()
"""
MAKE = "from threadpitch.cosim.temporary_folder import TemporaryFolder as T; a, b = T(), T(); a.close(); b.close()"


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def next_process() -> None:
    subprocess.run([sys.executable, "-c", MAKE], check=True, timeout=60)


def test_what_a_killed_process_left_is_removed_and_no_more(place: Path) -> None:
    command = [sys.executable, "-c", HOLD]
    running = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    dead, alive = (Path((one.stdout.readline() if one.stdout else "").strip()) for one in running)
    running[0].send_signal(signal.SIGKILL)
    running[0].communicate()
    foreign = place / "threadpitch-unpacked-notes"
    foreign.mkdir()
    (foreign / "thesis.txt").write_text("mine")
    link = place / "threadpitch-unpacked-link"
    link.symlink_to(foreign)
    assert dead.is_dir()
    try:
        next_process()
        assert not dead.parent.exists()
        assert (alive / "library.so").is_file()
        assert (foreign / "thesis.txt").is_file()
        assert link.is_symlink()
    finally:
        running[1].communicate()
    assert {path.name for path in place.iterdir()} == {foreign.name, link.name}


def test_a_lock_that_is_a_link_is_in_doubt(place: Path) -> None:
    home = place / "threadpitch-unpacked-abc"
    home.mkdir()
    (place / "target").write_text("")
    (home / "in-use").symlink_to(place / "target")
    next_process()
    assert home.is_dir()


def test_the_home_goes_with_the_last_folder(place: Path) -> None:
    one, other = TemporaryFolder(), TemporaryFolder()
    assert one.path.parent == other.path.parent
    assert one.path.parent.parent == place.resolve()
    one.close()
    assert other.path.is_dir()
    other.close()
    assert list(place.iterdir()) == []


def test_a_forked_child_has_a_home_of_its_own(place: Path) -> None:
    kept = TemporaryFolder()
    child = os.fork()
    if child == 0:
        own = TemporaryFolder()
        apart = own.path.parent != kept.path.parent
        own.close()
        kept.close()  # the folder is the parent's, but its home stays
        os._exit(0 if apart else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert kept.path.parent.is_dir()
    kept.close()
    assert list(place.iterdir()) == []
