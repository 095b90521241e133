"""The folder of traces: every file is named by the SHA-256 of its content, appears whole, and never changes.

    traces/ab/abcdef....parquet        content-addressed; equal traces of several runs are one file
    traces/unfinished/                 what is being written, or was when its writer died

Names come from digests only, never from what a user or a log says.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from threadpitch.store.errors import StoreError
from threadpitch.store.records import new_uid

ABANDONED = 3600.0  # s without a change, after which an unfinished file has no writer any more
_SUFFIX = ".parquet"
_UNFINISHED = "unfinished"
_PIECE = 2**20  # bytes


@dataclass(frozen=True)
class WrittenTrace:
    """A trace that is on the disk, but has not got its name yet."""

    path: Path
    sha256: str
    size: int  # bytes


class TraceFolder:
    """The traces of a store."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def file(self, sha256: str) -> Path:
        """Where the trace with this content is."""
        return self.path / sha256[:2] / f"{sha256}{_SUFFIX}"

    @contextlib.contextmanager
    def copied(self, source: Path) -> Iterator[WrittenTrace]:
        """A copy of a file, on the disk, until it gets its name or this ends.

        Raises:
            StoreError: the file cannot be read, or the folder not written.
        """
        unfinished = self.path / _UNFINISHED / f"{new_uid()}{_SUFFIX}"
        try:
            if not unfinished.parent.is_dir():
                unfinished.parent.mkdir(parents=True, exist_ok=True)
                for folder in (self.path, self.path.parent):
                    _sync_folder(folder)
            written = _copy(source, unfinished)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            raise StoreError(f"{error.filename or self.path}: the trace cannot be stored ({error.strerror}); is there "
                             "room, and may the folder be written?") from None
        try:
            yield written
        finally:
            unfinished.unlink(missing_ok=True)

    def name(self, written: WrittenTrace) -> None:
        """Give the trace its name, on the disk too. Only within a writing transaction: ``verify`` and ``delete``
        take files without a row for leftovers.
        """
        target = self.file(written.sha256)
        try:
            made = not target.parent.exists()
            target.parent.mkdir(parents=True, exist_ok=True)
            # Also where one is there already: it may be damaged, and this one is not.
            os.replace(written.path, target)
            for folder in (target.parent, *([self.path] if made else [])):
                _sync_folder(folder)
        except FileNotFoundError:
            if not target.exists():  # else this transaction is repeated, and it has its name
                raise
        except OSError as error:
            raise StoreError(f"{target}: the trace cannot be stored ({error.strerror}); may the folder be "
                             "written?") from None

    def remove(self, sha256: str) -> None:
        """Remove a trace that no run has. Only within a writing transaction."""
        self.file(sha256).unlink(missing_ok=True)

    def digests(self) -> Iterator[str]:
        """The digests that the files are named by."""
        for path in sorted(self.path.glob(f"[0-9a-f][0-9a-f]/*{_SUFFIX}")):
            yield path.name.removesuffix(_SUFFIX)

    def abandoned(self) -> Iterator[Path]:
        """Unfinished files whose writers must be dead."""
        for path in sorted((self.path / _UNFINISHED).glob(f"*{_SUFFIX}")):
            with contextlib.suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > ABANDONED:
                    yield path


def sha256_of(path: Path) -> str:
    """The digest of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _copy(source: Path, target: Path) -> WrittenTrace:
    digest, size = hashlib.sha256(), 0
    with source.open("rb") as file, target.open("xb") as copy:
        while piece := file.read(_PIECE):
            digest.update(piece)
            size += copy.write(piece)
        copy.flush()
        os.fsync(copy.fileno())
    return WrittenTrace(target, digest.hexdigest(), size)


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":
        return  # Windows writes names with the files
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
