"""FMU archives with equal bytes for equal content, which appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

_FIRST_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can hold: entries carry no time of the build
_UNIX = 3
_READABLE = 0o100644
_EXECUTABLE = 0o100755


def write_archive(path: Path, entries: Mapping[str, bytes]) -> None:
    """Write the zip file: entries by name, fixed times; the file takes its place in one move.

    Raises:
        OSError: the folder cannot be made or written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream, zipfile.ZipFile(stream, "w") as archive:
            for name in sorted(entries):
                archive.writestr(_entry(name), entries[name], zipfile.ZIP_DEFLATED, 9)
        Path(temporary).chmod(0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _FIRST_DATE)
    entry.create_system = _UNIX
    entry.external_attr = (_EXECUTABLE if name.startswith("binaries/") else _READABLE) << 16
    return entry
