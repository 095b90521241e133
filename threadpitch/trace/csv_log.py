"""Reader for text logs, plain or compressed by gzip: rows -> pieces of passes.

The standard library's ``csv`` splits the rows: it is the only reader at hand that keeps the number of every line for
the messages. Long well-formed stretches are read by pyarrow where that is installed (``fast_text``).
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from threadpitch.trace import fast_text
from threadpitch.trace.choice import ColumnChoice, brief, choose
from threadpitch.trace.passes import Array, Cutter, Piece
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray
from threadpitch.trace.text_head import Head
from threadpitch.trace.text_rows import Block, Place, Text, headed, split


class TextLog:
    """A text log: its columns are known when it is made, its pieces can be read once.

    Raises (the class itself, and while the pieces are read):
        TraceError: with file and line: whatever keeps the file from being read, a column that is not there, text or
            NaN in a number, rows of unequal length, no threading row.
    """

    def __init__(self, source: str, texts: Generator[str], choice: ColumnChoice, place: Place | None = None) -> None:
        self.source = source
        self._place = place or Place()
        self._file = texts
        self._texts = headed(texts, source)
        try:
            self._begin(choice)
        except BaseException:
            self.close()
            raise

    @property
    def share(self) -> float | None:
        """Of the file's bytes that are read, 0 to 1, where their number is known."""
        return self._place.share

    def close(self) -> None:
        """Close the file."""
        self._texts.close()
        self._file.close()

    def _begin(self, choice: ColumnChoice) -> None:
        for head, text in self._texts:
            block = split(text, head, self.source)
            if block.rows:
                break
        else:
            raise TraceError(f"{self.source}: there are no rows below the header")
        self.head, self._first = head, block
        place = f"{self.source}:{head.line}"
        if head.numbered and not (choice.angle or "").isdigit():
            raise TraceError(f"{place}: the first row holds numbers; give a header with the names of the columns, or "
                             "choose the columns by number, from 1")
        chosen = choose(place, head.names, choice, head.units)
        if chosen.time is not None and chosen.time_is_guessed and not _is_number(block.rows[0][chosen.time]):
            chosen = replace(chosen, time=None)  # what is only called time, but holds a date, is no time in seconds
        self.chosen = replace(chosen, notes=(*chosen.notes, *head.notes))

    def pieces(self) -> Iterator[Piece]:
        """The threading rows, as long as they have one label and lie in one text."""
        cutter = Cutter(self.source, self.chosen, [name.strip() for name in self.head.names])
        yield from self._of_rows(self._first, cutter)
        for _, text in self._texts:
            yield from self._of_text(text, cutter)
        cutter.end()

    def _of_text(self, text: Text, cutter: Cutter) -> Iterator[Piece]:
        group = self.chosen.group
        numbers = [column for column in self.chosen.columns if column != group]
        fast = fast_text.columns_of(text, self.head, numbers, group)
        if fast is None:
            yield from self._of_rows(split(text, self.head, self.source), cutter)
            return
        lines = np.arange(text.before + 1, text.before + 1 + fast.size)
        yield from cutter.pieces(fast.size, fast.texts, lambda column, part: fast.numbers[column][part], lines)

    def _of_rows(self, block: Block, cutter: Cutter) -> Iterator[Piece]:
        group = self.chosen.group
        groups: Array | None = None
        if group is not None:
            groups = np.array([row[group] for row in block.rows], dtype=object)

        def numbers(column: int, part: slice) -> FloatArray:
            return _numbers(Block(block.lines[part], block.rows[part]), column, self.head, self.source)

        yield from cutter.pieces(len(block.rows), groups, numbers, np.array(block.lines, dtype=np.int64))


def _numbers(block: Block, column: int, head: Head, source: str) -> FloatArray:
    try:
        found = np.fromiter((float(row[column]) for row in block.rows), np.float64, len(block.rows))
    except ValueError:
        found = None
    if found is not None and not any("_" in row[column] for row in block.rows):  # Python reads 1_0 as 10
        return found
    line, text = next((line, row[column]) for line, row in zip(block.lines, block.rows, strict=True)
                      if not _is_number(row[column]))
    name = head.names[column].strip()
    if not text.strip():
        raise TraceError(f"{source}:{line}: column {brief(name)} is empty; mend or leave out this row")
    mend = "write the decimal sign as a point" if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text) else "mend this row"
    raise TraceError(f"{source}:{line}: column {brief(name)} holds {brief(text)}, not a number; {mend}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
