"""Rows of a log -> pieces of its passes: cut where the column changes that parts them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.trace.choice import Chosen, brief
from threadpitch.trace.recording import IntArray, TraceError
from threadpitch.trace.soundness import FloatArray

Array = NDArray[Any]
Numbers = Callable[[int, slice], FloatArray]  # the numbers of a column in a part of the rows

_NO_GROUP = {"", "0", "false", "nan", "none", "off"}  # of a group's value: not threading
_HALF = 0.5  # a level is high above it


@dataclass(frozen=True, eq=False)
class Piece:
    """Neighbouring samples of one pass, as the file gives them."""

    label: str
    opens: bool  # begins a pass
    angle: FloatArray  # (samples,) with ``angle_b``: level A of the encoder
    position: FloatArray  # (samples,)
    time: FloatArray | None = None  # (samples,)
    lines: IntArray | None = None  # (samples,) line of the file, from 1
    angle_b: FloatArray | None = None  # (samples,) level B of the encoder
    index: FloatArray | None = None  # (samples,) one-turn pulse


class Labels(dict[str, str]):
    """Text of the group column -> label, "" for rows that are not threading; each text is read once."""

    def __missing__(self, text: str) -> str:
        label = text.strip()
        try:
            number = float(label) if "_" not in label else math.nan  # Python reads 1_0 as 10
            if number == 0.0:
                label = ""
            elif number.is_integer() and abs(number) < 1e15:
                label = str(int(number))  # 1, 1.0 and 1e0 are one group
        except ValueError:
            pass
        self[text] = "" if label.casefold() in _NO_GROUP else label
        return self[text]


class Cutter:
    """Cuts the rows of a log, chunk by chunk, at the borders of its passes."""

    def __init__(self, source: str, chosen: Chosen, names: list[str]) -> None:
        self.chosen = chosen
        self._source, self._names = source, names
        self._labels = Labels()
        self._label = ""  # of the row before
        self._found = False
        self._falls = 0
        self._high = False  # the index enable in the row before

    def pieces(self, size: int, groups: Array | None, numbers: Numbers, lines: IntArray | None = None) \
            -> Iterator[Piece]:
        """The threading rows of a chunk of ``size`` rows, as long as they have one label.

        ``groups`` (size,) is the group column, where there is one; ``numbers`` is asked for threading rows only.
        """
        for first, last, label in self._runs(size, groups, numbers):
            if label:
                part = slice(first, last)
                self._found = True
                columns = {name: numbers(column, part) for name, column in self.chosen.numbers.items()}
                yield Piece(label, label != self._label, lines=None if lines is None else lines[part], **columns)
            self._label = label

    def end(self) -> None:
        """All rows were seen.

        Raises:
            TraceError: none of them was threading.
        """
        if self._found:
            return
        if self.chosen.index_enable is not None:
            name = brief(self._names[self.chosen.index_enable])
            raise TraceError(f"{self._source}: no pass begins: column {name} never falls from 1 to 0; choose another "
                             "index enable or none")
        name = brief(self._names[self.chosen.group]) if self.chosen.group is not None else ""
        raise TraceError(f"{self._source}: no row is threading: column {name} is 0, empty or false everywhere; "
                         "choose another group column or none")

    def _runs(self, size: int, groups: Array | None, numbers: Numbers) -> Iterator[tuple[int, int, str]]:
        if size == 0:
            return
        values = groups
        name_of: Callable[[Any], str] = self._label_of
        if self.chosen.index_enable is not None:
            values = self._falls_so_far(numbers(self.chosen.index_enable, slice(0, size)))
            name_of = _fall
        if values is None:
            yield 0, size, "1"
            return
        borders = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist(), size]
        for first, last in pairwise(borders):
            yield first, last, name_of(values[first])

    def _label_of(self, value: Any) -> str:
        return self._labels[_text(value)]

    def _falls_so_far(self, levels: FloatArray) -> IntArray:
        """Number of times that the index enable has fallen, and 0 while it is high."""
        high = levels > _HALF
        before = np.concatenate(([self._high], high[:-1]))
        falls: IntArray = self._falls + np.cumsum(before & ~high)
        self._falls, self._high = int(falls[-1]), bool(high[-1])
        return np.where(high, 0, falls)


def _fall(number: Any) -> str:
    return str(number) if number else ""


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return str(value)
