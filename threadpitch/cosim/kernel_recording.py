"""Recording in the compiled loop: a row keeps of its values those pieces that have changed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined] # Numba's own types leave it out

from threadpitch.compiled import compiled as compiled_by_numba
from threadpitch.cosim.calls import copy_bytes, pointer
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
    places = carray(pointer(span.places + np.uint64(4 * row * count)), (count,), np.uint32)
    for p in range(count):
        piece = tables.pieces[p]
        if tables.latest[p] == NOWHERE or changed(tables, piece, span.words + WORD * tables.latest[p]):
            used = tables.latest[count]
            for r in range(piece.first_run, piece.last_run):
                run = tables.runs[r]
                copy_bytes(span.words + WORD * used + run.target, run.source, run.count)
            tables.latest[p] = used
            tables.latest[count] = used + piece.words
        places[p] = tables.latest[p]


@inlined
def changed(tables: Tables, piece: Any, latest: int) -> Any:
    """Whether a value of the piece is another one, bit by bit, than in the latest row."""
    different = np.uint64(0)
    if piece.fixed != 0:
        return False
    for r in range(piece.first_run, piece.last_run):
        run = tables.runs[r]
        count = np.int64(run.count // WORD)
        now, before = words_at(run.source, count), words_at(latest + run.target, count)
        for n in range(count):
            different |= now[n] ^ before[n]
        for n in range(np.uint64(count) * WORD, run.count):
            different |= octet(run.source + n) ^ octet(latest + run.target + n)
    return different != 0


@inlined
def words_at(address: int, count: Any) -> Any:
    """So many words that begin at an address."""
    return carray(pointer(address), (count,), np.uint64)


@inlined
def octet(address: int) -> Any:
    """The byte at an address."""
    return np.uint64(carray(pointer(address), (1,), np.uint8)[0])
