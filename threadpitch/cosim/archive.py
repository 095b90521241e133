"""Unpacking of .ssp and .fmu files into folders that vanish, without a path that leaves them."""

from __future__ import annotations

import shutil
import stat
import tempfile
import weakref
import zipfile
from pathlib import Path, PurePosixPath

from threadpitch.cosim.errors import CosimError

MAXIMUM_SIZE = 4 * 2**30  # bytes unpacked; no FMU or SSP of the field comes near it


class ArchiveError(CosimError):
    """A file is not a sound ZIP archive."""


class TemporaryFolder:
    """A folder that is removed by ``close`` or, at the latest, when the last reference to it is gone."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="threadpitch-")).resolve()
        # A library that is still loaded keeps its file on Windows: what cannot be removed is left to the system.
        self._remove = weakref.finalize(self, shutil.rmtree, self.path, True)

    def close(self) -> None:
        """Remove the folder with all it holds; may be called twice."""
        self._remove()


def unpack(archive: Path) -> TemporaryFolder:
    """Unpack a ZIP file into a new temporary folder.

    Raises:
        ArchiveError: the file is missing, is not a ZIP archive, is damaged, or holds a member that would be
            written outside of the folder, is a symbolic link, or makes the whole larger than ``MAXIMUM_SIZE``.
    """
    try:
        with zipfile.ZipFile(archive) as packed:
            members = packed.infolist()
            for member in members:
                _check_member(archive, member)
            if sum(member.file_size for member in members) > MAXIMUM_SIZE:
                raise ArchiveError(f"{archive}: unpacks to more than {MAXIMUM_SIZE // 2**30} GiB; refused")
            folder = TemporaryFolder()
            packed.extractall(folder.path)
            return folder
    except FileNotFoundError:
        raise ArchiveError(f"{archive}: no such file") from None
    except IsADirectoryError:
        raise ArchiveError(f"{archive}: is a folder, not a file") from None
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise ArchiveError(f"{archive}: is not a readable ZIP archive ({error}); export it again") from None


def _check_member(archive: Path, member: zipfile.ZipInfo) -> None:
    name = member.orig_filename
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name or "\0" in name:
        raise ArchiveError(f"{archive}: member {name!r} would leave the folder it is unpacked to; refused")
    if stat.S_ISLNK(member.external_attr >> 16):
        raise ArchiveError(f"{archive}: member {name!r} is a symbolic link; refused")
