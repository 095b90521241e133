"""Single components computed once more with the inputs that they had in another run, compiled.

As long as what they give to others stays the same, bit for bit, so does all the rest of the system.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined] # Numba's own types leave it out
from numpy.typing import NDArray

from threadpitch.cosim.calls import copy_bytes, pointer
from threadpitch.cosim.kernel import attach, compiled, do_step, publish, receive, transfer
from threadpitch.cosim.kernel_recording import record
from threadpitch.cosim.tables import DONE, Span

DIFFERENT = -6  # a word of End.what besides those of ``tables``


class Script(NamedTuple):
    """What is computed anew and what is taken from the trace, by addresses; stretches count bytes of the memory."""

    trace: int  # address of row 0: the memory after initialisation, then after every step
    size: int  # bytes of a row
    memory: int
    nodes: int  # (node_count,) the components that are computed, in order
    node_count: int
    taken: int  # (taken_count, 2) first byte and how many, from the trace
    taken_count: int
    compared: int  # (compared_count, 2) what the computed components give to others
    compared_count: int


@compiled
def traced(at: Any, span: Span, trace: int, size: int, memory: int) -> Any:
    """As ``kernel.gauss_seidel``; after every step the memory of so many bytes is copied into its row of the trace."""
    tables = attach(at)
    for step in range(span.first, span.last):
        start = span.start + step * span.step_size
        for i in range(tables.nodes.size):
            what, status = receive(tables, i, start)
            if what == DONE:
                what, status = do_step(tables, i, start, span.step_size)
            if what == DONE:
                what, status = publish(tables, i, span.start + (step + 1) * span.step_size)
            if what != DONE:
                return step, i, what, status
        record(tables, step + 1, span)
        copy_bytes(np.uint64(trace) + np.uint64(step + 1) * np.uint64(size), np.uint64(memory), np.uint64(size))
    return span.last, 0, DONE, 0


@compiled
def replay(at: Any, span: Span, script: Script) -> Any:
    """Compute some nodes with the inputs of the trace; ends at the first step whose outputs differ from the trace's."""
    tables = attach(at)
    nodes = carray(pointer(script.nodes), (script.node_count,), np.int64)
    taken = carray(pointer(script.taken), (script.taken_count, 2), np.uint64)
    compared = carray(pointer(script.compared), (script.compared_count, 2), np.int64)
    memory = tables.memory.u1
    for step in range(span.first, span.last):
        row = np.uint64(script.trace) + np.uint64(step + 1) * np.uint64(script.size)
        for n in range(taken.shape[0]):
            copy_bytes(np.uint64(script.memory) + taken[n, 0], row + taken[n, 0], taken[n, 1])
        start = span.start + step * span.step_size
        for n in range(nodes.size):
            i = nodes[n]
            tables.starts[i] = start
            what, status = transfer(tables, tables.nodes[i].instance, tables.nodes[i].first_set,
                                    tables.nodes[i].last_set)
            if what == DONE:
                what, status = do_step(tables, i, start, span.step_size)
            if what == DONE:
                what, status = publish(tables, i, span.start + (step + 1) * span.step_size)
            if what != DONE:
                return step, i, what, status
        before = carray(pointer(row), (script.size,), np.uint8)
        for n in range(compared.shape[0]):
            for byte in range(compared[n, 0], compared[n, 0] + compared[n, 1]):
                if memory[byte] != before[byte]:
                    return step, 0, DIFFERENT, 0
        record(tables, step + 1, span)
    return span.last, 0, DONE, 0


def stretches(mask: NDArray[np.bool_], dtype: type[np.generic]) -> NDArray[Any]:
    """The stretches of bytes that a mask chooses: (stretches, 2) first byte and how many."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    return np.ascontiguousarray(np.stack([edges[::2], edges[1::2] - edges[::2]], axis=1).astype(dtype))
