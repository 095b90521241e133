"""Folders that vanish: at the latest with the process, and what ``kill -9`` leaves behind at the next start.

All folders of a process lie in one of its own, beside a file that it holds locked. The system gives the lock up when
the process is gone, however it went: only what nobody holds is removed, and only of this user.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

_PREFIX = "threadpitch-unpacked-"
_LOCK = "in-use"
_mutex = threading.RLock()  # the collector may remove a folder while another one is made


@dataclass
class _Home:
    """Where this process has its folders; ``lock`` is None where the file system knows no locks."""

    path: Path
    lock: IO[bytes] | None
    process: int
    folders: int = 0


_home: _Home | None = None
_looked_into: set[str] = set()  # places where this process has removed what others left


class TemporaryFolder:
    """A folder that is removed by ``close`` or, at the latest, when the last reference to it is gone.

    ``size`` is what was unpacked into it, bytes.
    """

    def __init__(self) -> None:
        with _mutex:
            home = _own_home()
            home.folders += 1
            try:
                self.path = Path(tempfile.mkdtemp(dir=home.path)).resolve()
            except OSError:
                _remove(home, home.path / "none")
                raise
        self.size = 0
        self._remove = weakref.finalize(self, _remove, home, self.path)

    def close(self) -> None:
        """Remove the folder with all it holds; may be called twice."""
        self._remove()


def _own_home() -> _Home:
    """That of this process in the present place for temporary files; a forked child makes its own."""
    global _home
    place = tempfile.gettempdir()
    if _home is None or _home.process != os.getpid() or str(_home.path.parent) != place:
        if place not in _looked_into:
            _looked_into.add(place)
            _remove_abandoned(Path(place))
        path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=place))
        _home = _Home(path, _locked(path), os.getpid())
    return _home


def _remove(home: _Home, folder: Path) -> None:
    """Remove one folder and, with the last, the home."""
    global _home
    # A library that is still loaded keeps its file on Windows: what cannot be removed is left to the next start.
    shutil.rmtree(folder, ignore_errors=True)
    if home.process != os.getpid():
        return  # a forked child: the home is its parent's
    with _mutex:
        home.folders -= 1
        if home.folders == 0:
            _home = None if _home is home else _home
            if home.lock is not None:
                home.lock.close()
            shutil.rmtree(home.path, ignore_errors=True)


def _locked(path: Path) -> IO[bytes] | None:
    """The file that says that the folder is in use; it gets its name when it is locked."""
    file = (path / f"{_LOCK}.new").open("xb")
    if not _lock(file):
        file.close()
        return None
    with contextlib.suppress(OSError):
        (path / f"{_LOCK}.new").rename(path / _LOCK)  # Windows renames no open files: nothing is cleaned up there
    return file


def _lock(file: IO[bytes]) -> bool:
    """Whether nobody else holds the lock, which is ours from now on until the file is closed."""
    try:
        if sys.platform == "win32":
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_abandoned(place: Path) -> None:
    """Remove what processes that are gone have left; anything in doubt stays."""
    with contextlib.suppress(OSError), os.scandir(place) as entries:
        for entry in entries:
            if entry.name.startswith(_PREFIX) and _ours(entry.path, stat.S_ISDIR):
                lock = Path(entry.path) / _LOCK
                if not _ours(lock, stat.S_ISREG):
                    continue
                with contextlib.suppress(OSError), lock.open("rb+") as file:
                    if _lock(file):
                        shutil.rmtree(entry.path, ignore_errors=True)


def _ours(path: str | Path, kind: Callable[[int], bool]) -> bool:
    """Whether it is of this kind, no link, and of this user."""
    try:
        found = os.lstat(path)
    except OSError:
        return False
    return kind(found.st_mode) and (sys.platform == "win32" or found.st_uid == os.getuid())
