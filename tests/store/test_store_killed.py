"""kill -9 of four writers at random moments: what was acknowledged is there, and nothing is half written.

The long variant, with figures: ``python -m tests.benchmarks.bench_store_kills``.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.store.postgres import Server
from threadpitch.store import NewEvent, open_store

KILLS = 12
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="fork and SIGKILL of POSIX")


def killed(address: str, kills: int = KILLS) -> dict[str, object]:
    done = subprocess.run([sys.executable, "-m", "tests.store.killed_writers", address, "--kills", str(kills)],
                          capture_output=True, text=True, check=False, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stdout + done.stderr
    return dict(json.loads(done.stdout))


@POSIX
def test_killed_writers_leave_sqlite_whole(tmp_path: Path) -> None:
    found = killed(str(tmp_path / "runs.db"))
    assert found["faults"] == []
    assert found["acknowledged_runs"] != 0


@POSIX
def test_killed_writers_leave_postgresql_whole(server: Server) -> None:
    found = killed(server.url)
    assert found["faults"] == []
    assert found["acknowledged_runs"] != 0


@POSIX
def test_a_killed_postgresql_has_all_that_was_acknowledged(server: Server) -> None:
    """It recovers from its log."""
    with open_store(server.url) as store:
        last = store.append([NewEvent("begin", {"n": n}) for n in range(5)])
        server.kill()
        server.start()
        assert store.last_sequence() == last  # the same store: the lost connection is replaced
        assert store.append([NewEvent("begin", {})]) == last + 1
        assert [one for one in store.verify() if not one.harmless] == []
