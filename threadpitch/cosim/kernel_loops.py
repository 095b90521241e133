"""The couplings, compiled, that go back to kept states: the sentences of ``algorithms`` over tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined] # Numba's own types leave it out

from threadpitch.cosim import iteration
from threadpitch.cosim.algorithms import NEXT_TO_NOTHING
from threadpitch.cosim.calls import call_two, pointer
from threadpitch.cosim.kernel import (
    WARNING,
    attach,
    compiled,
    do_step,
    gauss_seidel,
    inlined,
    publish,
    receive,
)
from threadpitch.cosim.kernel_recording import record
from threadpitch.cosim.tables import DONE, STATE_FAILED, UNSETTLED, Span, Tables

begin_iteration = inlined(iteration.begin_iteration)
settled = inlined(iteration.settled)
unchanged = inlined(iteration.unchanged)
add_column = inlined(iteration.add_column)
fit = inlined(iteration.fit)
feed = inlined(iteration.feed)


@compiled
def jacobi(at: Any, span: Span) -> Any:
    """All components receive their inputs at t, then all step to t + h, then all publish their outputs at t + h."""
    tables = attach(at)
    for step in range(span.first, span.last):
        for i in range(tables.nodes.size):
            if step % tables.nodes[i].multiple == 0:
                what, status = receive(tables, i, span.start + step * span.step_size)
                if what != DONE:
                    return step, i, what, status
        for i in range(tables.nodes.size):
            multiple = tables.nodes[i].multiple
            if (step + 1) % multiple == 0:
                start = span.start + (step + 1 - multiple) * span.step_size
                what, status = do_step(tables, i, start, multiple * span.step_size)
                if what != DONE:
                    return step, i, what, status
        for i in range(tables.nodes.size):
            if (step + 1) % tables.nodes[i].multiple == 0:
                what, status = publish(tables, i, span.start + (step + 1) * span.step_size)
                if what != DONE:
                    return step, i, what, status
        for i in range(tables.nodes.size):
            if tables.nodes[i].slot != 0 and (step + 1) % tables.nodes[i].multiple == 0:
                what, status = look_ahead(tables, i, span.start + (step + 1) * span.step_size, span)
                if what != DONE:
                    return step, i, what, status
        record(tables, step + 1, span)
    return span.last, 0, DONE, 0


@compiled
def look_ahead(tables: Tables, i: int, time: float, span: Span) -> Any:
    """Publish what the outputs are with the inputs of this time, by a step that is taken back."""
    what, status = save(tables, i)
    if what == DONE:
        what, status = receive(tables, i, time)
    if what == DONE:
        what, status = do_step(tables, i, time, NEXT_TO_NOTHING * span.step_size)
    if what == DONE:
        what, status = publish(tables, i, time)
    if what == DONE:
        what, status = restore(tables, i)
    return what, status


@compiled
def iterated(at: Any, span: Span) -> Any:
    """As Gauss-Seidel, but components that feed each other are repeated until they agree on the values at t + h."""
    tables = attach(at)
    for step in range(span.first, span.last):
        i, number = 0, 0
        while i < tables.nodes.size:
            if number < tables.loops.size and tables.loops[number].first == i:
                node, what, status = iterate(tables, number, step, span)
                i = tables.loops[number].last
                number += 1
            else:
                node = i
                what, status = compute(tables, i, step, span)
                i += 1
            if what != DONE:
                return step, node, what, status
        record(tables, step + 1, span)
    return span.last, 0, DONE, 0


@compiled
def compute(tables: Tables, i: int, step: int, span: Span) -> Any:
    """One component receives its inputs, steps and publishes its outputs."""
    start = span.start + step * span.step_size
    what, status = receive(tables, i, start)
    if what == DONE:
        what, status = do_step(tables, i, start, span.step_size)
    if what == DONE:
        what, status = publish(tables, i, span.start + (step + 1) * span.step_size)
    return what, status


@compiled
def iterate(tables: Tables, number: int, step: int, span: Span) -> Any:
    """Sweep by sweep from the same states: the node that failed, what and the status."""
    loop, reals, octets = tables.loops[number], tables.memory.f8, tables.memory.u1
    for i in range(loop.first, loop.last):
        what, status = save(tables, i)
        if what != DONE:
            return i, what, status
    begin_iteration(tables.iterates, loop, reals, octets)
    columns = 0
    for sweep in range(1, span.iterations + 1):
        for i in range(loop.first, loop.last):
            if sweep > 1:
                what, status = restore(tables, i)
                if what != DONE:
                    return i, what, status
            what, status = compute(tables, i, step, span)
            if what != DONE:
                return i, what, status
        rests = settled(tables.iterates, loop, reals, span.tolerance)
        same = unchanged(tables.iterates, loop, octets)
        if rests and same and sweep > 1:
            return loop.first, DONE, np.int64(0)
        columns = add_column(tables.iterates, loop, reals, sweep, columns)
        if not same:
            columns = 0
        feed(tables.iterates, loop, reals, fit(tables.iterates, loop, sweep, columns))
    return loop.first, UNSETTLED, np.int64(0)


@inlined
def save(tables: Tables, i: int) -> Any:
    """Keep the instance's state."""
    node = tables.nodes[i]
    status = np.int64(call_two(node.get_state, node.instance, node.slot))
    return (STATE_FAILED if status > WARNING else DONE), status


@inlined
def restore(tables: Tables, i: int) -> Any:
    """Go back to the state that was kept."""
    node = tables.nodes[i]
    state = carray(pointer(node.slot), (1,), np.uintp)[0]
    status = np.int64(call_two(node.set_state, node.instance, state))
    return (STATE_FAILED if status > WARNING else DONE), status


COUPLINGS = {"gauss-seidel": gauss_seidel, "jacobi": jacobi, "iterated": iterated}
