"""The user's cache folder: what is built once is kept there by its content."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path


def cache_folder() -> Path:
    """``THREADPITCH_CACHE``, or the platform's folder for caches of this user."""
    chosen = os.environ.get("THREADPITCH_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "threadpitch" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "threadpitch"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "threadpitch"


def write_file(path: Path, content: bytes) -> None:
    """Write the file in one move, so that another process sees it whole or not at all.

    Raises:
        OSError: the folder cannot be made or written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Make the folder with these files where it is not there yet; two processes may do it at once.

    Raises:
        OSError: the folder cannot be made or written.
    """
    for name, content in files.items():
        if not (folder / name).is_file():
            write_file(folder / name, content)
