"""What is recorded while a run goes on: ``Recorder`` holds a block of rows, which leaves for a file when it is full."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import WORD, Block, Blocks, Channel, Channels, Column, Times, whole_places
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.events import EventRecord
from threadpitch.cosim.schedule import Schedule

FILE_BLOCK = 32 * 2**20  # bytes that rows for a file may take
FILE_ROWS = 2**15  # that go to a file together
MEMORY_BLOCK = 128 * 2**20  # bytes that rows in memory may take; of these only what has changed is ever touched
_TOGETHER = 256  # rows whose places are written at once


class Columns(Protocol):
    """Recorded columns, in memory or in a file."""

    @property
    def times(self) -> Times:
        """Communication points, (rows,) s."""

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""


class Sink(Protocol):
    """Where blocks go while a run computes."""

    def take(self, block: Block) -> bool:
        """Keep some rows; a file keeps them whatever happens to this process. Whether the block itself is kept."""

    def position(self) -> dict[str, int]:
        """How much has been taken: what a later process hands over to go on from here."""

    def close(self) -> Columns:
        """End writing; nothing is taken after that."""


class MemoryRows:
    """Rows in memory. ``count`` of them must fit in.

    Raises (the class itself):
        CosimError: the rows do not fit into the memory.
    """

    def __init__(self, channels: Channels, count: int = 0) -> None:
        self._channels = channels
        self._blocks: list[Block] = []
        room(channels, count)

    def take(self, block: Block) -> bool:
        """Keep the block itself, or its rows where these are but a small part of it."""
        kept = 2 * len(block) * self._channels.row_words > block.words.size
        self._blocks.append(block if kept else block.compact())
        return kept

    def position(self) -> dict[str, int]:
        """The number of rows."""
        return {"rows": sum(map(len, self._blocks))}

    def close(self) -> Blocks:
        """The rows themselves."""
        return Blocks(self._channels, self._blocks)


def room(channels: Channels, count: int) -> tuple[Times, NDArray[np.uint32], NDArray[np.int64]]:
    """Memory for rows: their times, their places, and their words if all values change in every one.

    Raises:
        CosimError: there is not so much.
    """
    directory = -(-count * len(channels.pieces) // 2)  # words: two places each
    try:
        # One stretch, because NumPy takes large pages for large ones: rows are the first to touch them.
        words = np.empty(directory + count * channels.row_words, np.int64)
        places = words[:directory].view(np.uint32)[:count * len(channels.pieces)].reshape(count, len(channels.pieces))
        return np.empty(count), places, words[directory:]
    except (MemoryError, ValueError):
        raise CosimError(f"{count} rows of {len(channels.all)} variables do not fit into the memory; record fewer "
                         "variables, every n-th step only, into a file, or take a larger step") from None


class Taking:
    """A selection of what is recorded, on its way to a sink: some columns, and all rows or some.

    Of the rows it takes every n-th, row 0 included; with names in ``on`` only those of them in which one of these
    variables differs from the row that was looked at before, and row 0. ``taken`` counts them.
    """

    def __init__(self, channels: Channels, sink: Sink, *, every: int = 1, on: Iterable[str] = ()) -> None:
        self.channels = channels
        self.sink = sink
        self.every = every
        names = set(on)
        self.on = tuple(channel for channel in channels.all if channel.name in names)
        self.last: Block | None = None  # the row that was looked at last
        self.taken = 0

    def again(self) -> Taking:
        """The same selection, not begun yet, into memory."""
        return Taking(self.channels, MemoryRows(self.channels), every=self.every,
                      on=[channel.name for channel in self.on])

    def take(self, block: Block, first: int) -> bool:
        """Take what is wanted of some rows, the first of which has this number in the run. Whether the sink keeps the
        block itself.
        """
        if self.every > 1:
            block = block.some(slice(-first % self.every, None, self.every))
        if self.on and len(block):
            block = self._changed(block)
        if not len(block):
            return False
        self.taken += len(block)
        return self.sink.take(block.of(self.channels))

    def _changed(self, block: Block) -> Block:
        """The rows that differ from the one before; what is not a number in both does not differ."""
        mask = np.zeros(len(block), np.bool_)
        mask[0] = self.last is None
        for piece, channels in _by_piece(block.channels, self.on).items():
            places = block.places[:, piece]
            moved = np.flatnonzero(places[1:] != places[:-1]) + 1  # in other rows all of the piece is what it was
            before, after = block.some(moved - 1), block.some(moved)
            for channel in channels:
                mask[moved] |= _differ(before.column(channel), after.column(channel))
                if self.last is not None:
                    mask[:1] |= _differ(self.last.column(channel), block.some(slice(1)).column(channel))
        self.last = block.some(slice(len(block) - 1, None)).of(self.channels).compact()
        return block.some(mask)


def _by_piece(layout: Channels, channels: Iterable[Channel]) -> dict[int, list[Channel]]:
    """The channels by the number of the piece in which they lie."""
    found: dict[int, list[Channel]] = {}
    for channel in channels:
        found.setdefault(layout.piece(channel), []).append(channel)
    return found


def _differ(before: Column, after: Column) -> NDArray[np.bool_]:
    different = before != after
    if before.dtype.kind == "f" and different.any():
        different &= ~(np.isnan(before) & np.isnan(after))
    return np.asarray(different)


class Recorder:
    """Values at communication points, in a block of rows that leaves for the takings when it is full.

    Row r of all belongs to the point r * every, row 0 to the values after initialisation; ``drained`` rows have left
    the block, ``filled`` are in it. ``rows[width]`` are the rows of the block as plain Python writes them, whole: row r
    at word r * row_words. The kernel writes what has changed, behind the ``used`` words; ``places`` (rows, pieces)
    tells where. ``steps`` counts the steps that were computed. Without takings all rows are kept in memory.

    Raises (the class itself):
        CosimError: the rows do not fit into the memory, or ``every`` is not a positive whole number.
    """

    def __init__(self, channels: Iterable[Channel] | Channels, schedule: Schedule, every: int = 1,
                 takings: Sequence[Taking] = ()) -> None:
        check_every(every)
        self.schedule = schedule
        self.every = every
        self.layout = channels if isinstance(channels, Channels) else Channels(channels)
        self.channels = self.layout.all
        self.by_width = self.layout.by_width
        count = schedule.steps // every + 1
        self.takings = tuple(takings) or (Taking(self.layout, MemoryRows(self.layout, count)),)
        files = any(not isinstance(taking.sink, MemoryRows) for taking in self.takings)
        most = max(1, (FILE_BLOCK if files else MEMORY_BLOCK) // max(self.layout.row_words * WORD, 1))
        self._size = min(count, most, FILE_ROWS if files else most)
        self.drained = 0
        self.steps = 0
        self.events: list[EventRecord] = []
        self._begin()

    def _begin(self) -> None:
        """An empty block."""
        self.times, self.places, self.words = room(self.layout, self._size)
        self.rows = self.layout.whole(self.words, self._size)
        self.filled, self.used, self._whole = 0, 0, 0

    @property
    def completed(self) -> bool:
        """Whether all steps were computed and recorded."""
        return self.steps == self.schedule.steps and self.drained + self.filled > self.steps // self.every

    def add(self, time: float) -> int:
        """The place of a new row in the block, which is drained before where it is full."""
        if self.filled == self.times.size:
            self._turn_over()
        if self.filled >= self._whole:
            self._whole = min(self.filled + _TOGETHER, self._size)
            self.places[self.filled:self._whole] = whole_places(self.layout, range(self.filled, self._whole))
        self.times[self.filled] = time
        self.filled += 1
        self.used = self.filled * self.layout.row_words
        return self.filled - 1

    def room(self) -> int:
        """The number of the step up to which rows fit into the block, which is drained where it is full."""
        if self.filled == self.times.size:
            self._turn_over()
        return (self.drained + self._size) * self.every - 1

    def advance(self, steps: int, used: int) -> None:
        """Take over rows that the kernel wrote: ``steps`` are done in all, so many words are used."""
        filled = steps // self.every + 1 - self.drained
        points = np.arange(self.drained + self.filled, self.drained + filled, dtype=np.float64)
        self.times[self.filled:filled] = self.schedule.start_time + points * self.every * self.schedule.step_size
        self.steps, self.filled, self.used = steps, filled, used

    def block(self, first: int) -> Block:
        """The rows of the block from this one on, where they lie."""
        rows = slice(first, self.filled)
        return Block(self.layout, self.times[rows], self.words[:self.used], self.places[rows])

    def drain(self) -> None:
        """Hand the rows over, and begin the block anew: in the same memory where nobody keeps it."""
        if not self.filled:
            return
        block = self.block(0)
        kept = [taking.take(block, self.drained) for taking in self.takings]
        self.drained += self.filled
        if any(kept):
            self.times = np.empty(0)  # no block, until there is a row again
        elif self.used < self.filled * self.layout.row_words:
            self._whole = 0
        self.filled, self.used = 0, 0

    def _turn_over(self) -> None:
        self.drain()
        if not self.times.size:
            self._begin()

    def begin(self) -> None:
        """Record another run, into the same block of rows, and for the same selections, which are kept in memory."""
        self.takings = tuple(taking.again() for taking in self.takings)
        self.events.clear()
        self.go_on(0, 0)
        self._whole = 0
        if not self.times.size:
            self._begin()

    def go_on(self, steps: int, drained: int) -> None:
        """Take over where a former process was, which had drained its rows."""
        self.steps, self.drained, self.filled, self.used = steps, drained, 0, 0


def check_every(every: object) -> None:
    """Refuse what counts no steps.

    Raises:
        CosimError: it is not a positive whole number.
    """
    if not isinstance(every, int) or every < 1:
        raise CosimError(f"every {every!r}-th step cannot be recorded; give 1 or more")
