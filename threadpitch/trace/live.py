"""Lines of a text while it is written: every line as soon as its end is there."""

from __future__ import annotations

import codecs
import os
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from pathlib import Path

from threadpitch.trace.recording import TraceError
from threadpitch.trace.text_rows import CLOSED_INPUT, GZIP, LONGEST_LINE, STANDARD_INPUT

_POLL = 0.002  # s, between two looks at a file that did not grow
_BYTES = 1 << 16  # that are read at once
_HEAD = 4  # lines that must be there before the first are handed on: names, units, and rows for the decimal sign


def live_texts(path: Path, idle: float) -> Generator[str]:
    """Texts of whole lines in the order in which they come; without the end of a line that never came.

    Raises:
        TraceError: the file is missing or became shorter, or holds a gigantic line or zero bytes.
    """
    decoder = codecs.getincrementaldecoder("utf-8-sig")(errors="replace")
    waiting: list[str] = []  # lines before the head is whole
    rest, count = "", 0
    for data in _bytes_of(path, idle):
        if not count and not rest and data.startswith(GZIP):
            raise TraceError(f"{path}: is packed by gzip, which cannot be read while it is written; analyze it")
        text = rest + decoder.decode(data)
        *lines, rest = text.split("\n")
        if len(text) >= LONGEST_LINE or "\0" in text:
            _refuse_what_is_no_row(path, count + 1, [*lines, rest])
        count += len(lines)
        lines = [line.rstrip("\r") for line in lines]
        if count < _HEAD:
            waiting += lines
            continue
        if waiting or lines:
            yield "\n".join([*waiting, *lines, ""])
            waiting = []
    if waiting or rest.strip():
        yield "\n".join([*waiting, rest])


def _refuse_what_is_no_row(path: Path, first: int, lines: list[str]) -> None:
    for number, line in enumerate(lines, start=first):
        if len(line) >= LONGEST_LINE:
            raise TraceError(f"{path}:{number}: a line of more than {LONGEST_LINE} characters; give a text log with "
                             "one row per sample")
        if "\0" in line:
            raise TraceError(f"{path}:{number}: a zero byte in the text; is this a text log?")


def _bytes_of(path: Path, idle: float) -> Iterator[bytes]:
    """Bytes as they come, never empty."""
    with ExitStack() as stack:
        growing = str(path) != STANDARD_INPUT
        if not growing and sys.stdin is None:
            raise TraceError(CLOSED_INPUT)
        try:
            file = stack.enter_context(open(path, "rb", buffering=0)).fileno() if growing else sys.stdin.fileno()
        except FileNotFoundError:
            raise TraceError(f"{path}: there is no such file; start the recording first") from None
        except OSError as error:
            raise TraceError(f"{path}: cannot be read ({error.strerror or error})") from None
        last = time.monotonic()
        read = 0
        while True:
            data = os.read(file, _BYTES)
            if data:
                last, read = time.monotonic(), read + len(data)
                yield data
            elif not growing or time.monotonic() - last > idle:
                return
            elif os.fstat(file).st_size < read:
                raise TraceError(f"{path}: the file became shorter while it was watched; start again")
            else:
                time.sleep(_POLL)
