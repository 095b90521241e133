"""Reader for text logs, plain or compressed by gzip: rows -> pieces of groups.

The standard library's ``csv`` splits the rows, block by block: it is the only reader at hand that keeps the number of
every line for the messages (numpy's readers name neither file nor line, and take no text column beside numbers
without a second pass), and the large readers (pandas, polars, arrow) would be the heaviest dependency of all.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator
from dataclasses import replace
from itertools import groupby

import numpy as np

from threadpitch.trace.choice import ColumnChoice, brief, choose
from threadpitch.trace.groups import Labels, Piece
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import FloatArray
from threadpitch.trace.text_rows import Block


class TextLog:
    """A text log: its columns are known when it is made, its pieces can be read once.

    Raises (the class itself, and while the pieces are read):
        TraceError: with file and line: whatever keeps the file from being read, a column that is not there, text or
            NaN in a number, rows of unequal length, no threading row.
    """

    def __init__(self, source: str, blocks: Generator[Block], choice: ColumnChoice) -> None:
        self.source = source
        self._blocks = blocks
        try:
            self._begin(choice)
        except TraceError:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._blocks.close()

    def _begin(self, choice: ColumnChoice) -> None:
        self._first = next(self._blocks, None)
        if self._first is None:
            raise TraceError(f"{self.source}: there are no rows below the header")
        place = f"{self.source}:{self._first.header_line}"
        if self._first.numbered and not (choice.angle or "").isdigit():
            raise TraceError(f"{place}: the first row holds numbers; give a header with the names of the columns, or "
                             "choose the columns by number, from 1")
        self.chosen = choose(place, self._first.header, choice, self._first.units)
        if self._first.notes:
            self.chosen = replace(self.chosen, notes=(*self.chosen.notes, *self._first.notes))
        self._labels = Labels()
        self._label = ""  # of the row before

    def pieces(self) -> Iterator[Piece]:
        """The threading rows, as long as they have one label and lie in one block."""
        assert self._first is not None
        threading = False
        for block in self._all_blocks(self._first):
            for piece in self._of_block(block):
                threading = True
                yield piece
        if not threading:
            group = self.chosen.group
            name = brief(self._first.header[group].strip()) if group is not None else ""
            raise TraceError(f"{self.source}: no row is threading: column {name} is 0, empty or false everywhere; "
                             "choose another group column or none")

    def _all_blocks(self, first: Block) -> Iterator[Block]:
        yield first
        yield from self._blocks

    def _of_block(self, block: Block) -> Iterator[Piece]:
        group = self.chosen.group
        labels = ["1"] * len(block.rows) if group is None else [self._labels[row[group]] for row in block.rows]
        first = 0
        for label, run in groupby(labels):
            last = first + sum(1 for _ in run)
            if label:
                yield self._piece(label, label != self._label, block.part(first, last))
            self._label = label
            first = last

    def _piece(self, label: str, opens: bool, block: Block) -> Piece:
        self._drop_guessed_text(block.rows[0])
        chosen = self.chosen
        return Piece(
            label,
            opens,
            _numbers(block, chosen.angle),
            _numbers(block, chosen.position),
            None if chosen.time is None else _numbers(block, chosen.time),
            np.array(block.lines, dtype=np.int64),
        )

    def _drop_guessed_text(self, row: list[str]) -> None:
        """A column that is only called time, but holds a date, is not a time in seconds."""
        time = self.chosen.time
        if time is not None and self.chosen.time_is_guessed and not _is_number(row[time]):
            self.chosen = replace(self.chosen, time=None)
        self.chosen = replace(self.chosen, time_is_guessed=False)


def _numbers(block: Block, column: int) -> FloatArray:
    try:
        found = np.fromiter((float(row[column]) for row in block.rows), np.float64, len(block.rows))
    except ValueError:
        found = None
    if found is not None and not any("_" in row[column] for row in block.rows):  # Python reads 1_0 as 10
        return found
    line, text = next((line, row[column]) for line, row in zip(block.lines, block.rows, strict=True)
                      if not _is_number(row[column]))
    name = block.header[column].strip()
    if not text.strip():
        raise TraceError(f"{block.source}:{line}: column {brief(name)} is empty; mend or leave out this row")
    mend = "write the decimal sign as a point" if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text) else "mend this row"
    raise TraceError(f"{block.source}:{line}: column {brief(name)} holds {brief(text)}, not a number; {mend}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
