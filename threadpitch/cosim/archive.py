"""Unpacking of .ssp and .fmu files into folders that vanish: nothing leaves them, and nothing fills the disk."""

from __future__ import annotations

import errno
import itertools
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath

from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.temporary_folder import TemporaryFolder

MAXIMUM_SIZE = 4 * 2**30  # bytes unpacked; no FMU or SSP of the field comes near it
MOST_MEMBERS = 100_000  # of one archive; an FMU with Python and its libraries inside has some 10^4
LARGEST_RATIO = 200  # unpacked to packed: binaries and tables come to 10, deflate's limit is 1032
SMALL = 64 * 2**20  # bytes unpacked up to which any ratio is fine
_LOCAL_HEADER = 30  # bytes before a member's name
_ENCRYPTED = 0x1
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)


class ArchiveError(CosimError):
    """A file is not a sound ZIP archive."""


def unpack(archive: Path, name: str = "", room: int = MAXIMUM_SIZE) -> TemporaryFolder:
    """Unpack a ZIP file into a new temporary folder; ``name`` is what messages call it, ``room`` the bytes it may take.

    Raises:
        ArchiveError: the file is missing, is not a ZIP archive, is damaged or encrypted, holds a member that would be
            written outside of the folder, is a symbolic link, contradicts or overlaps another, or it
            unpacks to more than ``room``, or to so much more than its own size that nobody means it.
    """
    name = name or str(archive)
    folder = TemporaryFolder()
    try:
        with zipfile.ZipFile(archive) as packed:
            members = packed.infolist()
            problems = itertools.chain(_problems(members, archive.stat().st_size, room), _contradictions(packed))
            for problem in problems:
                raise ArchiveError(f"{name}: {problem}; refused")
            folder.size = sum(member.file_size for member in members)
            packed.extractall(folder.path)
            return folder
    except FileNotFoundError:
        raise ArchiveError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise ArchiveError(f"{name}: is a folder, not a file") from None
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, ValueError, zlib.error) as error:
        folder.close()
        if isinstance(error, ArchiveError):
            raise
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            place, why = tempfile.gettempdir(), str(error.strerror).lower()
            raise ArchiveError(f"{name}: cannot be unpacked into {place} ({why}); free some space there, or name "
                               "another folder in TMPDIR") from None
        raise ArchiveError(f"{name}: is not a readable ZIP archive ({error}); export it again") from None


def _problems(members: Sequence[zipfile.ZipInfo], packed_size: int, room: int) -> Iterator[str]:
    """What makes an archive unfit to be unpacked, as its directory tells."""
    if len(members) > MOST_MEMBERS:
        yield f"holds {len(members)} members, more than {MOST_MEMBERS}"
    for member in members:
        yield from _member_problems(member)
    size = sum(member.file_size for member in members)
    if size > room:
        yield f"unpacks to {size / 2**30:.3g} GiB, more than the {room / 2**30:.3g} GiB that are allowed"
    if size > SMALL and size > LARGEST_RATIO * packed_size:
        yield f"unpacks to {size / 2**20:.0f} MiB, {size / packed_size:.0f} times its own size"
    yield from _clashes(members)


def _member_problems(member: zipfile.ZipInfo) -> Iterator[str]:
    name = member.orig_filename
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name or "\0" in name:
        yield f"member {name!r} would leave the folder it is unpacked to"
    if stat.S_ISLNK(member.external_attr >> 16):
        yield f"member {name!r} is a symbolic link"
    if member.flag_bits & _ENCRYPTED:
        yield f"member {name!r} is encrypted"


def _contradictions(packed: zipfile.ZipFile) -> Iterator[str]:
    """Members of one name that differ: whose is read depends on the tool. Some tools write the same file twice."""
    seen: dict[PurePosixPath, zipfile.ZipInfo] = {}
    for member in packed.infolist():
        first = seen.setdefault(PurePosixPath(member.filename), member)
        if first is not member and not member.is_dir() and packed.read(first) != packed.read(member):
            yield f"member {member.filename!r} stands twice, with different content"


def _clashes(members: Sequence[zipfile.ZipInfo]) -> Iterator[str]:
    """Members that are made of the same packed bytes."""
    placed = sorted((member for member in members), key=lambda member: member.header_offset)
    for one, other in itertools.pairwise(placed):
        # The least that a member takes: its extra field may be longer than the directory says.
        end = one.header_offset + _LOCAL_HEADER + len(one.orig_filename) + one.compress_size
        if end > other.header_offset:
            yield f"members {one.filename!r} and {other.filename!r} overlap"
