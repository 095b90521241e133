"""A PostgreSQL server of the tests' own, in a folder of their own, reached by a socket in it."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

WHY_NOT = "needs PostgreSQL: initdb and postgres in /usr/lib/postgresql/*/bin, as root a user postgres"
_PATIENCE = 30.0  # s


class Server:
    """A server that runs as a child of this process."""

    def __init__(self, folder: Path, binaries: Path, durable: bool) -> None:
        self.folder = folder
        self._fsync = f"fsync={'on' if durable else 'off'}"
        self._binaries = binaries
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        """Of its one database, with the traces beside it."""
        return f"postgresql://postgres@/postgres?host={self.folder}&traces={self.folder / 'traces'}"

    def initialize(self) -> None:
        """Make the database's files."""
        done = self._child("initdb", "-D", self.folder / "cluster", "-A", "trust", "-U", "postgres", "-E", "UTF8", "-N")
        assert done.wait(_PATIENCE) == 0, self._log()

    def start(self) -> None:
        """Start it, or once more after it was killed."""
        self._process = self._child("postgres", "-D", self.folder / "cluster", "-k", self.folder,
                                    "-c", "listen_addresses=", "-c", "max_connections=40", "-c", self._fsync)
        deadline = time.monotonic() + _PATIENCE
        while self._child("pg_isready", "-h", self.folder, "-U", "postgres").wait(_PATIENCE) != 0:
            assert self._process.poll() is None, self._log()
            assert time.monotonic() < deadline, self._log()
            time.sleep(0.05)

    def stop(self) -> None:
        """Stop it in order."""
        self._end(signal.SIGINT)

    def kill(self) -> None:
        """kill -9: what it has not written is lost, as in a power cut."""
        self._end(signal.SIGKILL)

    def _end(self, how: signal.Signals) -> None:
        assert self._process is not None
        self._process.send_signal(how)
        self._process.wait(_PATIENCE)
        self._process = None

    def _child(self, name: str, *arguments: str | Path) -> subprocess.Popen[bytes]:
        user = "postgres" if os.getuid() == 0 else None  # it refuses to run as root
        with (self.folder / "log").open("ab") as log:
            return subprocess.Popen([self._binaries / name, *arguments], stdout=log, stderr=log, cwd=self.folder,
                                    user=user, group=user, extra_groups=None if user is None else [])

    def _log(self) -> str:
        return (self.folder / "log").read_text(encoding="utf-8")


def installed() -> Path | None:
    """The folder of the newest server's programs, where they can be used."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: float(path.parts[-3]))
    if not found:
        return None
    if os.getuid() == 0:
        import pwd

        try:
            pwd.getpwnam("postgres")
        except KeyError:
            return None
    return found[-1].parent


@contextlib.contextmanager
def server(durable: bool = False) -> Iterator[Server]:
    """A new server; its folder is removed. What is not durable outlives the server's processes, not the computer."""
    binaries = installed()
    assert binaries is not None, WHY_NOT
    with tempfile.TemporaryDirectory(prefix="tp-pg-", dir="/tmp") as name:  # a socket's path is at most 107 letters
        if os.getuid() == 0:
            shutil.chown(name, "postgres", "postgres")
        one = Server(Path(name), binaries, durable)
        one.initialize()
        one.start()
        try:
            yield one
        finally:
            one.stop()
