"""Text files of rows: opened, unpacked and split, block by block, with the number of every line."""

from __future__ import annotations

import csv
import difflib
import gzip
import sys
import zlib
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

from threadpitch.trace.choice import brief
from threadpitch.trace.recording import TraceError
from threadpitch.trace.text_head import Head, find_head

STANDARD_INPUT = "-"  # as a file's name
BLOCK = 1 << 20  # characters that are read at once
LONGEST_LINE = 1 << 16  # characters; a row of numbers is far shorter
_GZIP = b"\x1f\x8b"


@dataclass(frozen=True)
class Block:
    """Some rows of a file, each as long as the header, with their lines (from 1)."""

    source: str
    header: list[str]
    header_line: int
    lines: list[int]
    rows: list[list[str]]
    units: list[str]  # of the columns, where the file gives them in a row of their own; "" for none
    notes: tuple[str, ...] = ()  # how the text was read
    numbered: bool = False  # there is no header: the columns are numbered

    def part(self, first: int, last: int) -> Block:
        """The rows from ``first`` up to ``last``."""
        return replace(self, lines=self.lines[first:last], rows=self.rows[first:last])


def rows_of(path: Path) -> Generator[Block]:
    """The rows of a text file in blocks; blank rows and comments (#, %, //) are left out.

    Raises:
        TraceError: the file is missing, a directory, empty, binary, cut off, or its rows differ in length.
    """
    with _opened(path) as stream:
        yield from rows_of_lines(_line_blocks(stream, str(path)), str(path))


def rows_of_lines(blocks: Iterable[list[str]], source: str) -> Generator[Block]:
    """The rows out of blocks of whole lines.

    What stands above the rows, the separator and the decimal sign are found in the first block (``text_head``).

    Raises:
        TraceError: there is no row, or the rows differ in length.
    """
    head: Head | None = None
    line = 0  # lines above the block
    for text in blocks:
        if head is None:
            if not any(row.strip() for row in text):
                line += len(text)
                continue
            head = find_head(text, source, line)
            line, text = line + head.lines, text[head.lines :]
        empty = Block(source, head.names, head.line, [], [], head.units, head.notes, head.numbered)
        block = _split(text, head, empty, line)
        line += len(text)
        if block.rows:
            yield block
    if head is None:
        raise TraceError(f"{source}: the file is empty; give a log with a header and rows")


@contextmanager
def _opened(path: Path) -> Iterator[IO[str]]:
    source = str(path)
    if source == STANDARD_INPUT:
        yield sys.stdin
        return
    try:
        with open(path, "rb") as raw:
            packed = raw.read(2) == _GZIP
        with (gzip.open if packed else open)(path, "rb") as probe:
            encoding = _encoding(probe.read(1 << 16), source)
        with (gzip.open if packed else open)(path, "rt", encoding=encoding, errors="replace") as stream:
            yield stream
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


def _line_blocks(stream: IO[str], source: str) -> Iterator[list[str]]:
    """Lists of whole lines without their ends; memory is bounded whatever the file holds."""
    line = 1
    while text := stream.read(BLOCK):
        rest = stream.readline(LONGEST_LINE)
        lines = (text + rest).split("\n")
        if not lines[-1]:
            lines.pop()
        for i, one in enumerate(lines):
            if len(one) >= LONGEST_LINE:
                raise TraceError(f"{source}:{line + i}: a line of more than {LONGEST_LINE} characters; "
                                 "give a CSV log with one row per sample")
            if "\0" in one:
                raise TraceError(f"{source}:{line + i}: a zero byte in the text; the log is damaged from here on")
        line += len(lines)
        yield lines


def _split(text: list[str], head: Head, empty: Block, before: int) -> Block:
    """The rows of these lines; ``before`` lines of the file stand above them."""
    reader = csv.reader(head.plain(text), delimiter=head.separator)
    rows: list[list[str]] = []
    for number, row in enumerate(reader, start=1):
        if reader.line_num != number:
            raise TraceError(f"{empty.source}:{before + number}: a quoted text is not closed in its line; close it")
        rows.append(row)
    width = len(empty.header)
    if all(len(row) == width for row in rows):
        return replace(empty, lines=list(range(before + 1, before + 1 + len(rows))), rows=rows)
    kept = [(before + i, row) for i, row in enumerate(rows, start=1) if any(cell.strip() for cell in row)]
    for line, row in kept:
        if len(row) == width + 1 and not row[-1].strip():
            row.pop()  # a separator at the end of the row
        if len(row) != width:
            raise TraceError(f"{empty.source}:{line}: {len(row)} fields where the header has {width}; mend this row "
                             f"(separator {head.separator!r})")
    return replace(empty, lines=[line for line, _ in kept], rows=[row for _, row in kept])
