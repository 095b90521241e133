"""The user's cache folder: what is built once is kept there by its content."""

from __future__ import annotations

import os
import sys
import uuid
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
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    # not by tempfile, which lets nobody else read: here the umask says who may
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.replace(temporary, path)
    except OSError as error:  # a full disk does not say which file it was
        temporary.unlink(missing_ok=True)
        raise OSError(error.errno, f"cannot be written ({str(error.strerror).lower()}); free some space, or choose "
                      "another folder (of the cache: THREADPITCH_CACHE)", str(path)) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Make the folder with these files, where they are not there yet; two processes may do it at once.

    Raises:
        OSError: the folder cannot be made or written.
    """
    for name, content in files.items():
        if not _holds(folder / name, content):
            write_file(folder / name, content)


def _holds(path: Path, content: bytes) -> bool:
    try:
        return path.read_bytes() == content
    except FileNotFoundError:
        return False
