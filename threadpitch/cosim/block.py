"""Recorded rows: what is recorded, and blocks of successive rows in which a value that does not change lies once.

The columns of a width (bytes of a value) are divided into pieces of some hundred bytes. A row holds, for every piece,
where its values lie among the block's words; rows in which a piece is the same point to the same words.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.variable import FmuVariable

Column: TypeAlias = NDArray[Any]  # (rows,)
Times: TypeAlias = NDArray[np.float64]  # (rows,)
Rows: TypeAlias = Mapping[int, NDArray[Any]]  # by width: (rows, channels of this width), whole numbers with the bits
WIDTHS = (8, 4, 2, 1)  # bytes of a value
WORD = 8  # bytes: every piece begins at a multiple
NEVER, ONE_OF_MANY, AT_EVENTS, ALWAYS = range(4)  # when a value changes
PIECE_SIZE = 256  # bytes: comparing takes little, and little is kept that has not changed
STRETCH_PIECES = 8  # that are compared at once
_FAMILIES = ("Real", "Integer", "Boolean")


@dataclass(frozen=True)
class Channel:
    """One recorded variable."""

    component: str
    variable: FmuVariable

    @cached_property
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


class Piece(NamedTuple):
    """Columns ``first`` to ``last`` - 1 of a width; in a row that is stored whole its words begin at ``word``.

    ``changes`` tells when its values do: NEVER, or that of the most restless one.
    """

    width: int
    first: int
    last: int
    word: int
    changes: int

    @property
    def words(self) -> int:
        """How many words its values take."""
        return -(-(self.last - self.first) * self.width // WORD)


class Channels:
    """The recorded variables, and where each lies in the rows.

    ``all`` lists Real variables first, then whole numbers, then Booleans; ``by_width[width]`` those whose values have
    ``width`` bytes, in the order of their columns: first what stays as it is, then what seldom changes, and of that
    what one component gives side by side. ``row_words`` are those of a row that is stored whole. ``stretches`` are
    pieces ``first`` to ``last`` - 1 that change, or stay as they are, together.
    """

    def __init__(self, channels: Iterable[Channel]) -> None:
        given = tuple(channels)
        self.all = tuple(sorted(given, key=lambda one: _FAMILIES.index(C_TYPES[one.variable.c_type].family)))
        self.by_width = {width: tuple(_ordered([one for one in self.all if one.width == width])) for width in WIDTHS}
        self.places = {channel.name: place for found in self.by_width.values() for place, channel in enumerate(found)}
        self.pieces = tuple(_pieces(self.by_width))
        self.stretches = tuple(_stretches(self.pieces))
        self.begins = np.array([piece.word for piece in self.pieces], np.int64)
        self.piece_words = np.array([piece.words for piece in self.pieces], np.int64)
        self.row_words = int(self.piece_words.sum())
        self.first_pieces = {piece.width: number for number, piece in reversed(list(enumerate(self.pieces)))}
        self._columns: dict[Channels, dict[int, NDArray[np.int64]]] = {}

    def columns(self, some: Channels) -> dict[int, NDArray[np.int64]]:
        """By width: which columns of a row hold the values of ``some``, in their order."""
        if some not in self._columns:  # every run of a study asks for the same
            self._columns[some] = {width: np.array([self.places[channel.name] for channel in found], np.int64)
                                   for width, found in some.by_width.items()}
        return self._columns[some]

    def piece(self, channel: Channel) -> int:
        """The number of the piece in which the channel lies."""
        width = channel.width
        return self.first_pieces[width] + self.places[channel.name] // (PIECE_SIZE // width)

    def empty(self, count: int) -> dict[int, NDArray[Any]]:
        """Room for rows."""
        return {width: np.empty((count, len(found)), f"i{width}") for width, found in self.by_width.items()}

    def whole(self, words: NDArray[np.int64], count: int) -> dict[int, NDArray[Any]]:
        """The first words as rows that are stored whole, one after another: the columns of each width."""
        table = words[:count * self.row_words].reshape(count, self.row_words)
        found = {}
        for width, channels in self.by_width.items():
            first = self.pieces[self.first_pieces[width]].word * (WORD // width) if channels else 0
            found[width] = table.view(f"i{width}")[:, first:first + len(channels)]
        return found


def _ordered(channels: Sequence[Channel]) -> list[Channel]:
    """By restlessness and component, in the order in which they are given else."""
    components = {name: place for place, name in enumerate(dict.fromkeys(channel.component for channel in channels))}
    return sorted(channels, key=lambda one: (_restlessness(one), components[one.component]))


def _restlessness(channel: Channel) -> int:
    """When a value may be expected to change."""
    if channel.variable.fixed:
        return NEVER
    if channel.variable.discrete:
        # Those of few bytes fill few pieces anyway, but in long runs if they are not parted.
        return ONE_OF_MANY if channel.variable.name.endswith("]") or channel.width < WORD else AT_EVENTS
    return ALWAYS


def _pieces(by_width: Mapping[int, Sequence[Channel]]) -> Iterator[Piece]:
    word = 0
    for width, channels in by_width.items():
        step = PIECE_SIZE // width
        for first in range(0, len(channels), step):
            inside = channels[first:first + step]
            piece = Piece(width, first, first + len(inside), word, max(map(_restlessness, inside)))
            yield piece
            word += piece.words


def _stretches(pieces: Sequence[Piece]) -> Iterator[tuple[int, int]]:
    """Pieces that change often stand alone; of the others, those that never change and those that may are parted."""
    last = 0
    for (_, _, often), found in groupby(
            pieces, lambda piece: (piece.width, piece.changes == NEVER, piece.changes > ONE_OF_MANY)):
        first, last = last, last + len(list(found))
        step = 1 if often else STRETCH_PIECES
        yield from ((begin, min(begin + step, last)) for begin in range(first, last, step))


@dataclass(frozen=True)
class Block:
    """Successive rows: their times, and their values: ``places`` (rows, pieces) is where those of a piece begin among
    the ``words``.
    """

    channels: Channels
    times: Times
    words: NDArray[np.int64]
    places: NDArray[np.integer[Any]]

    @classmethod
    def of_rows(cls, channels: Channels, times: Times, rows: Rows) -> Block:
        """Rows that are stored whole, from the columns of each width."""
        count = times.size
        words = np.zeros(count * channels.row_words, np.int64)
        for width, columns in channels.whole(words, count).items():
            columns[:] = rows[width]
        return cls(channels, times, words, whole_places(channels, range(count)))

    def __len__(self) -> int:
        return self.times.size

    def __iter__(self) -> Iterator[Block]:
        yield self

    @property
    def rows(self) -> Rows:
        """All values, by width."""
        found = self.channels.empty(len(self))
        for number, piece in enumerate(self.channels.pieces):
            inside = np.arange(piece.last - piece.first)
            first = self.places[:, number, None].astype(np.int64) * (WORD // piece.width)
            found[piece.width][:, piece.first:piece.last] = self.words.view(f"i{piece.width}")[first + inside]
        return found

    @property
    def newest(self) -> NDArray[np.int64]:
        """The words of the last row as one that is stored whole, (row words,)."""
        layout = self.channels
        shifts = np.repeat(self.places[-1].astype(np.int64) - layout.begins, layout.piece_words)
        return self.words[shifts + np.arange(layout.row_words)]

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""
        return channel.values(self._bits(channel))

    def _bits(self, channel: Channel) -> Column:
        width = channel.width
        inside = self.channels.places[channel.name] % (PIECE_SIZE // width)
        first = self.places[:, self.channels.piece(channel)].astype(np.int64) * (WORD // width)
        bits: Column = self.words.view(f"i{width}")[first + inside]
        return bits

    def some(self, which: NDArray[Any] | slice) -> Block:
        """The rows that a mask or slice chooses."""
        return Block(self.channels, self.times[which], self.words, self.places[which])

    def compact(self) -> Block:
        """The same rows in words of their own."""
        return Block.of_rows(self.channels, self.times.copy(), self.rows)

    def of(self, channels: Channels) -> Block:
        """The same rows with some of the columns."""
        if channels is self.channels:
            return self
        if 2 * len(channels.all) > len(self.channels.all):  # piece by piece is faster than column by column
            whole, columns = self.rows, self.channels.columns(channels)
            return Block.of_rows(channels, self.times, {width: whole[width][:, columns[width]] for width in WIDTHS})
        rows = channels.empty(len(self))
        for channel in channels.all:
            rows[channel.width][:, channels.places[channel.name]] = self._bits(channel)
        return Block.of_rows(channels, self.times, rows)


def whole_places(channels: Channels, numbers: range) -> NDArray[np.int64]:
    """The places of rows that are stored whole, one after another, from number 0 on: of those with these numbers."""
    return np.arange(numbers.start, numbers.stop, dtype=np.int64)[:, None] * channels.row_words + channels.begins


class Blocks:
    """Blocks that follow each other, as one table."""

    def __init__(self, channels: Channels, blocks: Sequence[Block]) -> None:
        self.channels = channels
        self._blocks = tuple(blocks)

    @cached_property
    def times(self) -> Times:
        """Communication points, (rows,) s."""
        return np.concatenate([np.empty(0), *(block.times for block in self._blocks)])

    @property
    def rows(self) -> Rows:
        """All values, by width."""
        parts = [block.rows for block in self._blocks] or [self.channels.empty(0)]
        return {width: np.concatenate([part[width] for part in parts]) for width in WIDTHS}

    def __len__(self) -> int:
        return sum(map(len, self._blocks))

    def __iter__(self) -> Iterator[Block]:
        return iter(self._blocks)

    def column(self, channel: Channel) -> Column:
        """The values of one variable, (rows,)."""
        columns = [block.column(channel) for block in self._blocks]
        return np.concatenate(columns) if columns else np.empty(0, channel.dtype)
