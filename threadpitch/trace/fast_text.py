"""Well-formed text by pyarrow's reader, where that is installed: many times as fast as row by row.

It is taken only where it must give the same numbers: what it refuses, and whatever may be read in two ways (quotes,
comments, blank rows), goes to the reader of rows, which also names the line of a fault. Both round a decimal number to
the nearest float64.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from threadpitch.trace.passes import Array
from threadpitch.trace.soundness import FloatArray
from threadpitch.trace.text_head import Head
from threadpitch.trace.text_rows import Text

LEAST = 1 << 14  # characters; shorter texts are not worth the call
_TWO_WAYS = ('"', "#", "%", "//", "(", "_")  # quotes, comments, nan(...), 1_0


@dataclass(frozen=True, eq=False)
class Columns:
    """The columns that were asked for, (rows,) each."""

    size: int
    numbers: dict[int, FloatArray]
    texts: Array | None


def columns_of(block: Text, head: Head, numbers: Sequence[int], texts: int | None) -> Columns | None:
    """Columns of numbers and a column of texts out of whole lines; None where the rows must be read one by one."""
    arrow = _arrow()
    text = block.text
    if arrow is None or len(text) < LEAST or texts in numbers or any(mark in text for mark in _TWO_WAYS):
        return None
    if head.words:
        text = _with_single_blanks(text)
    wanted = [*numbers, *([] if texts is None else [texts])]
    types = {str(column): arrow.float64() for column in numbers}
    if texts is not None:
        types[str(texts)] = arrow.dictionary(arrow.int32(), arrow.string())
    try:
        table = arrow.csv.read_csv(
            arrow.py_buffer(text.encode()),
            arrow.csv.ReadOptions(column_names=[str(i) for i in range(len(head.names))]),
            arrow.csv.ParseOptions(delimiter=head.separator, quote_char=False, ignore_empty_lines=False),
            arrow.csv.ConvertOptions(column_types=types, include_columns=[str(column) for column in wanted],
                                     null_values=[], decimal_point="," if head.decimal_comma else "."))
    except (arrow.ArrowException, ValueError):
        return None
    if table.num_rows != block.count:
        return None
    found = {column: np.ascontiguousarray(table.column(str(column)).to_numpy()) for column in numbers}
    return Columns(table.num_rows, found, None if texts is None else _texts_of(table.column(str(texts))))


def _texts_of(column: Any) -> Array:
    """Every text once in memory, (rows,) references to it."""
    parts = [np.array([*chunk.dictionary.to_pylist(), None], dtype=object)[np.asarray(chunk.indices)]
             for chunk in column.chunks]
    return np.concatenate(parts)


def _with_single_blanks(text: str) -> str:
    text = text.replace("\t", " ")
    while "  " in text:
        text = text.replace("  ", " ")
    text = text.replace(" \n", "\n").replace("\n ", "\n")
    return text.removeprefix(" ").removesuffix(" ")


@cache
def _arrow() -> Any:
    try:
        importlib.import_module("pyarrow.csv")
        return importlib.import_module("pyarrow")
    except ImportError:
        return None
