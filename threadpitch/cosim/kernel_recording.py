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
        first, last = stretch.first_piece, stretch.last_piece
        if last - first == 1:  # changes often: its latest words serve, and need not be kept in the newest row as well
            if empty or changed(tables, stretch.first_run, stretch.last_run, shift(tables, span, first)):
                take(tables, first, span)
        elif empty or changed(tables, stretch.first_run, stretch.last_run, np.uint64(0)):
            for p in range(first, last):
                piece = tables.pieces[p]
                if empty or changed(tables, piece.first_run, piece.last_run, np.uint64(0)):
                    take(tables, p, span)
                    newest = np.uint64(tables.newest.ctypes.data) + WORD * piece.word
                    copy_bytes(newest, newest + shift(tables, span, p), WORD * piece.words)
    places = carray(pointer(span.places + np.uint64(4 * row * count)), (count,), np.uint32)
    for p in range(count):
        places[p] = tables.latest[p]


@inlined
def changed(tables: Tables, first: int, last: int, behind: Any) -> Any:
    """Whether a value of these runs is another one, bit by bit, than in the row that lies so far behind the newest."""
    for r in range(first, last):
        run = tables.runs[r]
        if compare_bytes(run.source, run.newest + behind, run.count) != 0:
            return True
    return False


@inlined
def shift(tables: Tables, span: Span, p: int) -> Any:
    """How far behind its place in the newest row a piece lies among the words; modulo 2^64."""
    return span.words + WORD * (tables.latest[p] - tables.pieces[p].word) - np.uint64(tables.newest.ctypes.data)


@inlined
def take(tables: Tables, p: int, span: Span) -> None:
    """Copy a piece behind the words that are used."""
    piece, count = tables.pieces[p], tables.pieces.size
    tables.latest[p] = tables.latest[count]
    tables.latest[count] += piece.words
    behind = shift(tables, span, p)
    for r in range(piece.first_run, piece.last_run):
        run = tables.runs[r]
        copy_bytes(run.newest + behind, run.source, run.count)
