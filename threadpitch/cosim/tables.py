"""A network as arrays of plain records, which compiled code can walk through. Indices count values of their type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.extrapolation import Samples
from threadpitch.cosim.iteration import Iterates, Loop

TYPES = tuple(map(np.dtype, ("f8", "f4", "i8", "u8", "i4", "u4", "i2", "u2", "i1", "u1", "?")))  # by their codes

# One instance. `first_...` to `last_...` are its rows in the other tables.
NODE = np.dtype([
    ("fmi", "i8"), ("instance", "u8"), ("do_step", "u8"), ("multiple", "i8"),
    ("final", "i8"), ("get_state", "u8"), ("set_state", "u8"), ("slot", "u8"),
    *((f"{end}_{table}", "i8") for table in ("copy", "conversion", "follow", "set", "get", "watch")
      for end in ("first", "last"))])
# A C function of three to five arguments behind the instance, see calls.py.
CALL = np.dtype([("function", "u8"), ("references", "u8"), ("count", "u8"), ("fourth", "u8"), ("fifth", "u8"),
                 ("arguments", "i8")])
# `pairs` is the address of a table of whole numbers: `count` sources in rising order, then their targets.
COPY = np.dtype([("width", "i8"), ("source", "i8"), ("target", "i8")])
CONVERSION = np.dtype([("source_type", "i8"), ("source", "i8"), ("target_type", "i8"), ("target", "i8"),
                       ("factor", "f8"), ("shift", "f8"), ("pairs", "u8"), ("count", "i8")])
FOLLOW = np.dtype([("number", "i8"), ("giver", "i8"), ("source", "i8"), ("target", "i8"), ("order", "i8"),
                   ("first", "i8"), ("second", "i8"), ("plain", "i8"), ("factor", "f8"), ("shift", "f8")])
# Float64 (width 8) or Float32 values that follow each other.
WATCH = np.dtype([("address", "u8"), ("width", "i8"), ("count", "i8")])
# What is recorded together (see block.Piece): its runs, and its words in a row that is stored whole.
PIECE = np.dtype([("first_run", "i8"), ("last_run", "i8"), ("word", "u8"), ("words", "u8")])
# Pieces side by side that are compared at once: the fewest runs of all that can change in them.
STRETCH = np.dtype([("first_piece", "i8"), ("last_piece", "i8"), ("first_run", "i8"), ("last_run", "i8")])
# Bytes that follow each other in the memory and in a row that is stored whole: the addresses of the first of them in
# the memory and in the newest row.
RUN = np.dtype([("source", "u8"), ("newest", "u8"), ("count", "u8")])
LOOP = np.dtype([(name, "i8") for name in Loop._fields])
# What fmi3DoStep answers, in the order that calls.call_step3 knows.
ANSWER = np.dtype([("reached", "f8"), ("event", "u1"), ("ended", "u1"), ("early", "u1"), ("unused", "u1", (5,))])

Records = NDArray[np.void]


class Views(NamedTuple):
    """The memory of the network, by type."""

    f8: NDArray[np.float64]
    f4: NDArray[np.float32]
    i8: NDArray[np.int64]
    u8: NDArray[np.uint64]
    i4: NDArray[np.int32]
    u4: NDArray[np.uint32]
    i2: NDArray[np.int16]
    u2: NDArray[np.uint16]
    i1: NDArray[np.int8]
    u1: NDArray[np.uint8]


class Tables(NamedTuple):
    """All that the kernel works on."""

    nodes: Records
    copies: Records
    conversions: Records
    follows: Records
    calls: Records
    watches: Records
    answers: Records
    answer_places: NDArray[np.uintp]  # (nodes,) addresses of the answers
    memory: Views
    times: NDArray[np.float64]
    starts: NDArray[np.float64]
    samples: Samples
    stretches: Records
    pieces: Records
    runs: Records
    newest: NDArray[np.int64]  # (row words,) the row that was recorded last, where stretches are compared
    latest: NDArray[np.uint64]  # (pieces + 1,) the place of every piece in that row; then the words that are used
    loops: Records
    iterates: Iterates


class Span(NamedTuple):
    """Steps ``first`` to ``last`` - 1 that begin at ``start + n * step_size``; every n-th point is recorded.

    ``drained`` rows have left the recorder's block before, whose words and places lie at these addresses. Loops are
    iterated to the tolerance in so many sweeps.
    """

    first: int
    last: int
    start: float
    step_size: float
    every: int
    drained: int
    words: int
    places: int
    tolerance: float
    iterations: int


class End(NamedTuple):
    """Where and why the kernel returned: ``what`` is one of the words below, or the number of a call that failed.

    Compiled loops return it as a plain tuple. Numba makes a named one by running Python, where Ctrl-C may raise; then
    it goes on with what was not made, and the process crashes.
    """

    steps: int  # those that are done and recorded
    node: int
    what: int
    status: int


def stretches(numbers: Sequence[int]) -> list[tuple[int, int, int]]:
    """Ascending stretches of numbers, in their order: the first, its place in the sequence, how many."""
    found: list[tuple[int, int, int]] = []
    for place, number in enumerate(numbers):
        if found and number == found[-1][0] + found[-1][2]:
            found[-1] = (*found[-1][:2], found[-1][2] + 1)
        else:
            found.append((number, place, 1))
    return found


def places(tables: Tables) -> NDArray[np.uint64]:
    """Address, length and width of every array in the tables, (arrays, 3), in their order.

    Compiled code that is handed arrays counts the references to each of them in every call, which takes ten times
    what the loop itself does; arrays that it makes of addresses have no owner and no count.
    """
    arrays = [*tables[:8], *tables.memory, tables.times, tables.starts, *tables.samples, tables.stretches,
              tables.pieces, tables.runs, tables.newest, tables.latest, tables.loops, *tables.iterates]
    return np.array([(array.ctypes.data, array.shape[0], array.shape[1] if array.ndim == 2 else 1)
                     for array in arrays], np.uint64)


NOWHERE = np.uint64(2**64 - 1)  # the place of a piece that no row of the block has yet
DONE, STEP_FAILED, NOT_A_NUMBER, STATE_FAILED, UNSETTLED = -1, -2, -3, -4, -5


def code(dtype: np.dtype[Any]) -> int:
    """The number of a type in the tables."""
    return TYPES.index(dtype)
