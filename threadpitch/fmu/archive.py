"""FMU archives with equal bytes for equal content, which appear whole or not at all."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

from threadpitch.fmu.cache import write_file

_FIRST_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can hold: entries carry no time of the build
_UNIX = 3
_READABLE = 0o100644
_EXECUTABLE = 0o100755


def write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write the zip file: entries by name, fixed times; the file takes its place in one move.

    Raises:
        OSError: the folder cannot be made or written.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in sorted(entries):
            archive.writestr(_entry(name), entries[name], zipfile.ZIP_DEFLATED, 9)
    write_file(path, stream.getvalue())


def is_whole(path: Path) -> bool:
    """Whether the file is a zip file whose entries all have their checksums."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.testzip() is None
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError):
        return False


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _FIRST_DATE)
    entry.create_system = _UNIX
    entry.external_attr = (_EXECUTABLE if name.startswith("binaries/") else _READABLE) << 16
    return entry
