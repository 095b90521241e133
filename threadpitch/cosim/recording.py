"""What is recorded while a run goes on: ``Recorder`` holds a block of rows, which leaves for a file when it is full."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.events import EventRecord
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.variable import FmuVariable

Column: TypeAlias = NDArray[Any]  # (rows,)
Times: TypeAlias = NDArray[np.float64]  # (rows,)
Rows: TypeAlias = dict[int, NDArray[Any]]  # by width: (rows, channels of this width), whole numbers with the bits
WIDTHS = (8, 4, 2, 1)  # bytes of a value
BLOCK_SIZE = 32 * 2**20  # bytes
BLOCK_ROWS = 2**15
_FAMILIES = ("Real", "Integer", "Boolean")


@dataclass(frozen=True)
class Channel:
    """One recorded variable."""

    component: str
    variable: FmuVariable

    @property
    def name(self) -> str:
        """``component.variable``."""
        return f"{self.component}.{self.variable.name}"

    @property
    def width(self) -> int:
        """Bytes of a value."""
        return C_TYPES[self.variable.c_type].dtype.itemsize

    @property
    def boolean(self) -> bool:
        """Whether values are given out as truth values."""
        return C_TYPES[self.variable.c_type].family == "Boolean"

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values that are given out."""
        return np.dtype(np.bool_) if self.boolean else C_TYPES[self.variable.c_type].dtype

    def values(self, bits: Column) -> Column:
        """The values that whole numbers of the channel's width hold."""
        values = bits.view(C_TYPES[self.variable.c_type].dtype)
        return values != 0 if self.boolean else values


class Channels:
    """The recorded variables, and where each lies in the rows.

    ``all`` lists Real variables first, then whole numbers, then Booleans; ``by_width[width]`` those whose values have
    ``width`` bytes, in the order of their columns.
    """

    def __init__(self, channels: Iterable[Channel]) -> None:
        given = tuple(channels)
        self.all = tuple(sorted(given, key=lambda one: _FAMILIES.index(C_TYPES[one.variable.c_type].family)))
        self.by_width = {width: tuple(found for found in given if found.width == width) for width in WIDTHS}
        self.places = {channel.name: place for found in self.by_width.values() for place, channel in enumerate(found)}
        self.row_size = sum(width * len(found) for width, found in self.by_width.items())  # bytes

    def empty(self, count: int) -> Rows:
        """Room for rows."""
        return {width: np.empty((count, len(found)), f"i{width}") for width, found in self.by_width.items()}


@dataclass(frozen=True)
class Block:
    """Successive rows: their times, and their values by width."""

    channels: Channels
    times: Times
    rows: Rows

    def __len__(self) -> int:
        return self.times.size

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""
        return channel.values(self.rows[channel.width][:, self.channels.places[channel.name]])

    def some(self, which: NDArray[Any] | slice) -> Block:
        """The rows that a mask or slice chooses."""
        return Block(self.channels, self.times[which], {width: rows[which] for width, rows in self.rows.items()})

    def of(self, channels: Channels) -> Block:
        """The same rows with some of the columns."""
        if channels is self.channels:
            return self
        rows = {}
        for width, wanted in channels.by_width.items():
            rows[width] = self.rows[width][:, [self.channels.places[channel.name] for channel in wanted]]
        return Block(channels, self.times, rows)


class Columns(Protocol):
    """Recorded columns, in memory or in a file."""

    @property
    def times(self) -> Times:
        """Communication points, (rows,) s."""

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""


class Sink(Protocol):
    """Where blocks go while a run computes."""

    def take(self, block: Block) -> None:
        """Keep a copy of some rows; a file keeps them whatever happens to this process."""

    def position(self) -> dict[str, int]:
        """How much has been taken: what a later process hands over to go on from here."""

    def close(self) -> Columns:
        """End writing; nothing is taken after that."""


class MemoryRows:
    """Rows in memory: room for ``count`` of them, which is doubled when more come.

    Raises (the class itself):
        CosimError: the rows do not fit into the memory.
    """

    def __init__(self, channels: Channels, count: int = 0) -> None:
        self._channels = channels
        self._filled = 0
        self._times, self._rows = self._room(count)

    def take(self, block: Block) -> None:
        """Append rows."""
        filled = self._filled + len(block)
        if filled > self._times.size:
            before = self.close()
            self._times, self._rows = self._room(max(filled, 2 * self._times.size))
            self._put(slice(self._filled), before)
        self._put(slice(self._filled, filled), block)
        self._filled = filled

    def position(self) -> dict[str, int]:
        """The number of rows."""
        return {"rows": self._filled}

    def close(self) -> Block:
        """The rows themselves."""
        return Block(self._channels, self._times, self._rows).some(slice(self._filled))

    def _room(self, count: int) -> tuple[Times, Rows]:
        try:
            return np.empty(count), self._channels.empty(count)
        except (MemoryError, ValueError):
            raise CosimError(f"{count} rows of {len(self._channels.all)} variables do not fit into the memory; record "
                             "fewer variables, every n-th step only, into a file, or take a larger step") from None

    def _put(self, place: slice, block: Block) -> None:
        self._times[place] = block.times
        for width, rows in block.rows.items():
            self._rows[width][place] = rows


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

    def again(self, count: int) -> Taking:
        """The same selection, not begun yet, into memory with room for so many rows."""
        rows = 0 if self.on else count // self.every
        return Taking(self.channels, MemoryRows(self.channels, rows), every=self.every,
                      on=[channel.name for channel in self.on])

    def take(self, block: Block, first: int) -> None:
        """Take what is wanted of some rows, the first of which has this number in the run."""
        if self.every > 1:
            block = block.some(slice(-first % self.every, None, self.every))
        if self.on and len(block):
            block = self._changed(block)
        if len(block):
            self.sink.take(block.of(self.channels))
            self.taken += len(block)

    def _changed(self, block: Block) -> Block:
        mask = np.zeros(len(block), np.bool_)
        mask[0] = self.last is None
        for channel in self.on:
            column = block.column(channel)
            mask[1:] |= column[1:] != column[:-1]
            if self.last is not None:
                mask[0] |= bool(column[0] != self.last.column(channel)[0])
        self.last = block.some(np.array([len(block) - 1])).of(self.channels)
        return block.some(mask)


class Recorder:
    """Values at communication points, in a block of rows that is allocated once and leaves for the takings when full.

    ``rows[width]`` holds the values of ``width`` bytes as ``Channels`` says, ``times`` (rows,) their communication
    points. Row r of all belongs to the point r * every, row 0 to the values after initialisation; ``drained`` rows
    have left the block, ``filled`` are in it. ``steps`` counts the steps that were computed. Without takings
    all rows are kept in memory.

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
        size = min(count, BLOCK_ROWS, max(1, BLOCK_SIZE // max(self.layout.row_size, 1)))
        self.times = np.empty(size)
        self.rows = self.layout.empty(size)
        self.drained = 0
        self.filled = 0
        self.steps = 0
        self.events: list[EventRecord] = []

    @property
    def completed(self) -> bool:
        """Whether all steps were computed and recorded."""
        return self.steps == self.schedule.steps and self.drained + self.filled > self.steps // self.every

    def add(self, time: float) -> int:
        """The place of a new row in the block, which is drained before where it is full."""
        if self.filled == self.times.size:
            self.drain()
        self.times[self.filled] = time
        self.filled += 1
        return self.filled - 1

    def room(self) -> int:
        """The number of the step up to which rows fit into the block, which is drained where it is full."""
        if self.filled == self.times.size:
            self.drain()
        return (self.drained + self.times.size) * self.every - 1

    def advance(self, steps: int) -> None:
        """Take over rows that the kernel wrote: ``steps`` are done in all."""
        filled = steps // self.every + 1 - self.drained
        points = np.arange(self.drained + self.filled, self.drained + filled, dtype=np.float64)
        self.times[self.filled:filled] = self.schedule.start_time + points * self.every * self.schedule.step_size
        self.steps, self.filled = steps, filled

    def drain(self) -> None:
        """Hand the rows over, and begin the block anew."""
        block = Block(self.layout, self.times, self.rows).some(slice(self.filled))
        if len(block):
            for taking in self.takings:
                taking.take(block, self.drained)
        self.drained += self.filled
        self.filled = 0

    def begin(self) -> None:
        """Record another run, into the same block of rows, and for the same selections, which are kept in memory."""
        count = self.schedule.steps // self.every + 1
        self.takings = tuple(taking.again(count) for taking in self.takings)
        self.events.clear()
        self.go_on(0, 0)

    def go_on(self, steps: int, drained: int) -> None:
        """Take over where a former process was, which had drained its rows."""
        self.steps, self.drained, self.filled = steps, drained, 0


def check_every(every: object) -> None:
    """Refuse what counts no steps.

    Raises:
        CosimError: it is not a positive whole number.
    """
    if not isinstance(every, int) or every < 1:
        raise CosimError(f"every {every!r}-th step cannot be recorded; give 1 or more")
