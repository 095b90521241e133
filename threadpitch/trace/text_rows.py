"""Text files of rows: opened, unpacked and split, block by block, with the number of every line."""

from __future__ import annotations

import csv
import difflib
import gzip
import io
import os
import stat
import sys
import zlib
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TextIO

from threadpitch.trace.choice import brief
from threadpitch.trace.recording import TraceError
from threadpitch.trace.text_head import Head, find_head

STANDARD_INPUT = "-"  # as a file's name
BLOCK = 1 << 22  # characters that are read at once
_LOOKED_AT = 1 << 16  # bytes by which the encoding is told
LONGEST_LINE = 1 << 16  # characters; a row of numbers is far shorter
GZIP = b"\x1f\x8b"


@dataclass(frozen=True)
class Text:
    """Whole lines of a file below its head."""

    text: str
    before: int  # lines of the file above them
    count: int  # of the lines


@dataclass
class Place:
    """How far a file is read."""

    share: float | None = None  # of its bytes, 0 to 1; None = not known, as of a pipe


@dataclass(frozen=True)
class Block:
    """Some rows of a file, each as long as the header, with their lines (from 1)."""

    lines: list[int]
    rows: list[list[str]]


def rows_of(path: Path) -> Generator[tuple[Head, Block]]:
    """The rows of a text file, block by block, with its head.

    Raises:
        TraceError: as ``texts_of``, ``headed`` and ``split``.
    """
    with closing(texts_of(path)) as texts:
        for head, text in headed(texts, str(path)):
            yield head, split(text, head, str(path))


def texts_of(path: Path, place: Place | None = None) -> Generator[str]:
    """A text file, a pipe, or ``-``, plain or packed by gzip, in texts of whole lines; ``place`` is kept up to date.

    Raises:
        TraceError: the file is missing, a directory, binary or cut off.
    """
    with _opened(path, place or Place()) as stream:
        yield from _texts(stream)


def headed(texts: Iterable[str], source: str) -> Generator[tuple[Head, Text]]:
    """The texts below the head of a file, with the head, which is found in the first of them (``text_head``).

    Raises:
        TraceError: the file is empty, holds only comments, a zero byte or a gigantic line.
    """
    head: Head | None = None
    line = 0  # lines above the text
    for text in texts:
        _refuse_what_is_no_text(text, source, line + 1)
        count = text.count("\n") + (not text.endswith("\n"))
        if head is not None:
            yield head, Text(text, line, count)
        elif text.strip():
            lines = text.split("\n")
            head = find_head(lines[:count], source, line)
            yield head, Text("\n".join(lines[head.lines :]), line + head.lines, count - head.lines)
        line += count
    if head is None:
        raise TraceError(f"{source}: the file is empty; give a log with a header and rows")


@contextmanager
def _opened(path: Path, place: Place) -> Iterator[TextIO]:
    source = str(path)
    try:
        with _bytes_of(path, place) as raw:
            packed = raw.peek(2)[:2] == GZIP
            plain = io.BufferedReader(_Unpacked(raw), _LOOKED_AT) if packed else raw
            yield io.TextIOWrapper(plain, encoding=_encoding(plain.peek(_LOOKED_AT), source), errors="replace")
    except FileNotFoundError:
        raise TraceError(f"{source}: there is no such file{_nearest(path)}") from None
    except IsADirectoryError:
        raise TraceError(f"{source}: is a directory; give the log file in it") from None
    except EOFError:
        raise TraceError(f"{source}: the compressed file ends too early; copy or record it again") from None
    except (zlib.error, gzip.BadGzipFile) as error:
        raise TraceError(f"{source}: the compressed file is damaged ({error}); copy or record it again") from None
    except OSError as error:
        raise TraceError(f"{source}: cannot be read ({error.strerror or error})") from None


@contextmanager
def _bytes_of(path: Path, place: Place) -> Iterator[io.BufferedReader]:
    """The bytes of a file, which may be a pipe: nothing of it is read twice."""
    if str(path) == STANDARD_INPUT:
        yield io.BufferedReader(_Filled(sys.stdin.buffer), _LOOKED_AT)
        return
    with open(path, "rb") as file:
        status = os.fstat(file.fileno())
        counted = stat.S_ISREG(status.st_mode) and status.st_size > 0
        yield io.BufferedReader(_Counted(file, status.st_size, place) if counted else _Filled(file), _LOOKED_AT)


class _Filled(io.RawIOBase):
    """Fills what it is asked for, where a pipe would give what is there: the first look sees enough."""

    def __init__(self, source: BinaryIO | io.BufferedIOBase) -> None:
        self._source = source

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override] # typeshed: any writable buffer
        found = self._source.read(len(buffer))
        buffer[: len(found)] = found
        return len(found)


class _Counted(_Filled):
    """Tells how far it is read of a file of so many bytes."""

    def __init__(self, source: BinaryIO, size: int, place: Place) -> None:
        super().__init__(source)
        self._size, self._place = size, place
        self._read = 0

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override] # typeshed: any writable buffer
        found = super().readinto(buffer)
        self._read += found
        self._place.share = min(self._read / self._size, 1.0)  # the file may grow
        return found


class _Unpacked(_Filled):
    """What gzip packed."""

    def __init__(self, source: io.BufferedReader) -> None:
        super().__init__(gzip.GzipFile(fileobj=source))


def _nearest(path: Path) -> str:
    try:
        names = [other.name for other in path.parent.iterdir()]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names, n=3)
    return f"; nearest are {', '.join(brief(name) for name in near)}" if near else ""


def _encoding(start: bytes, source: str) -> str:
    """UTF-8, or the Windows code page in which many machines write their degree signs."""
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in start:
        raise TraceError(f"{source}: is not a text file (it holds zero bytes); give a CSV log, plain or as .csv.gz")
    try:
        start[:-4].decode("utf-8")  # the end may cut a character in two
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _texts(stream: TextIO) -> Iterator[str]:
    """Texts of whole lines; memory is bounded whatever the file holds. The first is short: it is split for the head."""
    size = _LOOKED_AT
    while text := stream.read(size):
        if not text.endswith("\n"):
            text += stream.readline(LONGEST_LINE)
        yield text
        size = BLOCK


def _refuse_what_is_no_text(text: str, source: str, line: int) -> None:
    """Zero bytes, and lines of ``LONGEST_LINE`` characters; ``line`` is the first line of the text."""
    zero = text.find("\0")
    begin = 0
    while len(text) - begin >= LONGEST_LINE and (zero < 0 or begin <= zero):
        end = text.rfind("\n", begin, begin + LONGEST_LINE)
        if end < 0:
            raise TraceError(f"{source}:{line + text.count(chr(10), 0, begin)}: a line of more than {LONGEST_LINE} "
                             "characters; give a CSV log with one row per sample")
        begin = end + 1
    if zero >= 0:
        raise TraceError(f"{source}:{line + text.count(chr(10), 0, zero)}: a zero byte in the text; the log is damaged "
                         "from here on")


def split(text: Text, head: Head, source: str) -> Block:
    """The rows of a text; blank rows and comments (#, %, //) are left out.

    Raises:
        TraceError: with the line: the rows differ in length, a quoted text is not closed.
    """
    lines = text.text.split("\n")
    if not lines[-1]:
        lines.pop()
    reader = csv.reader(head.plain(lines), delimiter=head.separator)
    rows: list[list[str]] = []
    for number, row in enumerate(reader, start=1):
        if reader.line_num != number:
            raise TraceError(f"{source}:{text.before + number}: a quoted text is not closed in its line; close it")
        rows.append(row)
    width = len(head.names)
    if all(len(row) == width for row in rows):
        return Block(list(range(text.before + 1, text.before + 1 + len(rows))), rows)
    kept = [(text.before + i, row) for i, row in enumerate(rows, start=1) if any(cell.strip() for cell in row)]
    for line, row in kept:
        if len(row) == width + 1 and not row[-1].strip():
            row.pop()  # a separator at the end of the row
        if len(row) != width:
            raise TraceError(f"{source}:{line}: {len(row)} fields where the header has {width}; mend this row "
                             f"(separator {head.separator!r})")
    return Block([line for line, _ in kept], [row for _, row in kept])
