"""Whether a file ends before its own headers say: a copy that broke off, a recorder that was switched off.

Only lengths are read: those of the segments (TDMS), elements (MAT) and blocks (MDF 4), the end of the file (HDF5), the
mark at the end (Parquet).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

_UNFINISHED = 0xFFFFFFFFFFFFFFFF  # length of a TDMS segment, or of an HDF5, that was never told
_COMPRESSED, _ALIGNED = 15, 8  # MAT: type of a compressed element; bytes to which the others are filled up
_BIG_ENDIAN = 1 << 6  # of a TDMS segment's contents
_GAP = 512  # zero bytes that may lie between two MDF blocks
_MOST_LINKS = 1 << 16  # of an MDF block; more are no links but damage


def cut_off(path: Path, name: str) -> str:
    """How much of a file of this format is there, in words; "" where nothing is known to be missing."""
    needed_of: dict[str, Callable[[BinaryIO, int], int]] = {
        "TDMS": _tdms, "MAT": _mat, "MDF": _mdf, "HDF5": _hdf5, "Parquet": _parquet}
    if name not in needed_of or not path.is_file():
        return ""
    size = path.stat().st_size
    with path.open("rb") as file:
        try:
            needed = needed_of[name](file, size)
        except struct.error:  # a header that is not whole
            return f"it ends in a header, after {size} bytes"
    if needed <= size:
        return ""
    if needed == _UNFINISHED:
        return f"its end is missing after {size} bytes"
    return f"{size} of at least {needed} bytes are there"


def _tdms(file: BinaryIO, size: int) -> int:
    """Segments: TDSm, contents, version, offset of the next one from the end of this lead-in of 28 bytes."""
    place = 0
    while place < size:
        file.seek(place)
        lead = file.read(28)
        if not lead.startswith(b"TDSm"):
            return size
        (contents,) = struct.unpack("<4xI20x", lead)
        (following,) = struct.unpack(">12xQ8x" if contents & _BIG_ENDIAN else "<12xQ8x", lead)
        if following == _UNFINISHED:  # the recorder did not close it; what is there can be read
            return size
        place += 28 + following
    return place


def _mat(file: BinaryIO, size: int) -> int:
    """Elements after a header of 128 bytes: type and number of bytes."""
    if size < 128:
        return _UNFINISHED
    file.seek(126)
    order = {b"IM": "<", b"MI": ">"}.get(file.read(2))
    if order is None:
        return size
    place = 128
    while place < size:
        file.seek(place)
        kind, count = struct.unpack(f"{order}II", file.read(8))
        place += 8 + (count if kind == _COMPRESSED else -(-count // _ALIGNED) * _ALIGNED)
    return place


def _mdf(file: BinaryIO, size: int) -> int:
    """Blocks of MDF 4 from byte 64 on: ##, name, 4 bytes, length, number of links, places of the blocks they mean."""
    file.seek(8)
    if not file.read(8).startswith(b"4"):
        return size
    place, needed, empty = 64, size, 0
    while place < size:
        file.seek(place)
        mark = file.read(4)
        if not mark.strip(b"\0") and empty < _GAP:
            place, empty = place + _ALIGNED, empty + _ALIGNED
            continue
        if not mark.startswith(b"##"):
            return needed
        empty = 0
        length, links = struct.unpack("<4xQQ", file.read(20))
        if links > _MOST_LINKS or length < 24 + 8 * links:
            return needed
        for target in struct.unpack(f"<{links}Q", file.read(8 * links)):
            needed = max(needed, min(target, _UNFINISHED - 1) + 1 if target else 0)
        place += -(-length // _ALIGNED) * _ALIGNED
        needed = max(needed, place if length % _ALIGNED == 0 else place - _ALIGNED + 1)
    return needed


def _hdf5(file: BinaryIO, size: int) -> int:
    """The superblock tells the end of the file: version 0 and 1 after three addresses, 2 and 3 after two."""
    beginning = next((place for place in (0, 512) if _at(file, place, 8) == b"\x89HDF\r\n\x1a\n"), None)
    if beginning is None:
        return size
    version, wide = _at(file, beginning + 8, 1), b"\x08"
    if version in (b"\0", b"\1") and _at(file, beginning + 13, 1) == wide:
        place = beginning + (40 if version == b"\0" else 44)
    elif version in (b"\2", b"\3") and _at(file, beginning + 9, 1) == wide:
        place = beginning + 28
    else:
        return size
    (end,) = struct.unpack("<Q", _at(file, place, 8))
    return size if end == _UNFINISHED else int(end)


def _parquet(file: BinaryIO, size: int) -> int:
    """PAR1, or PARE where it is encrypted, is at the end too."""
    return size if size >= 12 and _at(file, size - 4, 4) in (b"PAR1", b"PARE") else _UNFINISHED


def _at(file: BinaryIO, place: int, count: int) -> bytes:
    file.seek(place)
    return file.read(count)
