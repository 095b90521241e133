"""Recording in the compiled loop: a row keeps of its values those pieces that have changed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined] # Numba's own types leave it out

from threadpitch.compiled import compiled as compiled_by_numba
from threadpitch.cosim.calls import compare_bytes, copy_bytes, pointer
from threadpitch.cosim.tables import NOWHERE, Span, Tables

WORD = np.uint64(8)  # bytes

# Inlined, the arrays that the kernel makes are addresses in registers.
inlined = compiled_by_numba(forceinline=True)


@inlined
def record(tables: Tables, step: int, span: Span) -> None:
    """Note the row of the communication point, if it has one: pieces that have changed are copied behind the others."""
    if step % span.every != 0:
        return
    row, count = step // span.every - span.drained, tables.pieces.size
    empty = tables.latest[0] == NOWHERE
    for s in range(tables.stretches.size):
        stretch = tables.stretches[s]
        if not empty and not changed(tables, stretch.first_run, stretch.last_run):
            continue
        whole = empty or stretch.last_piece - stretch.first_piece == 1
        for p in range(stretch.first_piece, stretch.last_piece):
            piece = tables.pieces[p]
            if whole or changed(tables, piece.first_run, piece.last_run):
                take(tables, p, span)
    places = carray(pointer(span.places + np.uint64(4 * row * count)), (count,), np.uint32)
    for p in range(count):
        places[p] = tables.latest[p]


@inlined
def changed(tables: Tables, first: int, last: int) -> Any:
    """Whether a value of these runs is another one, bit by bit, than in the newest row."""
    for r in range(first, last):
        run = tables.runs[r]
        if compare_bytes(run.source, run.newest, run.count) != 0:
            return True
    return False


@inlined
def take(tables: Tables, p: int, span: Span) -> None:
    """Copy a piece into the newest row, and from there behind the words that are used."""
    piece, count = tables.pieces[p], tables.pieces.size
    for r in range(piece.first_run, piece.last_run):
        run = tables.runs[r]
        copy_bytes(run.newest, run.source, run.count)
    used = tables.latest[count]
    newest = np.uint64(tables.newest.ctypes.data) + WORD * piece.word
    copy_bytes(span.words + WORD * used, newest, WORD * piece.words)
    tables.latest[p] = used
    tables.latest[count] = used + piece.words
