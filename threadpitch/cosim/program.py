"""A network of loaded FMUs made ready for the kernel, and the way back from a failure in it to a named error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from threadpitch.cosim.algorithms import unsettled
from threadpitch.cosim.block import NEVER, WORD, Piece
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.instance import FmuInstance
from threadpitch.cosim.instance2 import FmuInstance2, derivative_arguments
from threadpitch.cosim.instance3 import FmuInstance3
from threadpitch.cosim.intermediate import function_address
from threadpitch.cosim.kernel_loops import COUPLINGS
from threadpitch.cosim.memory import Port
from threadpitch.cosim.network import Network
from threadpitch.cosim.node import Copy, Follow, Node, Watch
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.state_slot import FmuSlot
from threadpitch.cosim.tables import (
    ANSWER,
    CALL,
    CONVERSION,
    COPY,
    DONE,
    FOLLOW,
    LOOP,
    NODE,
    NOT_A_NUMBER,
    NOWHERE,
    PIECE,
    RUN,
    STATE_FAILED,
    STEP_FAILED,
    STRETCH,
    UNSETTLED,
    WATCH,
    End,
    Records,
    Span,
    Tables,
    Views,
    code,
    places,
    stretches,
)

Loop: TypeAlias = Callable[[Any, Span], Any]  # compiled: (addresses of the tables, steps) -> values of an End


class Program:
    """An algorithm over one network: ``program(network, schedule, steps)`` as those in ``algorithms``."""

    def __init__(self, network: Network) -> None:
        self._loop = COUPLINGS[network.method.coupling]
        self._instances: list[FmuInstance] = []
        self._functions: list[str] = []  # by call
        self._kept: list[object] = []  # arrays whose addresses are in the calls
        self._records: dict[str, list[tuple[Any, ...]]] = {
            table: [] for table in ("copy", "conversion", "follow", "call", "watch")}
        self._begin = network.octets.ctypes.data
        nodes = [self._node(node, network.multiples[node.number]) for node in network.nodes]
        self._tables = self._build(network, nodes)
        self.places = places(self._tables)

    def __call__(self, network: Network, schedule: Schedule, steps: range) -> None:
        """Compute these steps and record them.

        Raises:
            StepError: as the plain algorithm.
        """
        self.compute(network, schedule, steps, self._loop)

    def compute(self, network: Network, schedule: Schedule, steps: range, loop: Loop) -> None:
        """As a call, with another compiled loop over the same tables.

        Raises:
            StepError: as the plain algorithm.
        """
        recorder = network.recorder
        first = steps.start
        while first < steps.stop:
            last = min(steps.stop, recorder.room())
            end = End(*loop(self.places, self.span(network, schedule, range(first, last))))
            recorder.advance(end.steps, self.used)
            if end.what != DONE:
                self._fail(network, schedule, end)
            first = last

    @property
    def used(self) -> int:
        """The words of the recorder's block that the rows take."""
        return int(self._tables.latest[-1])

    def span(self, network: Network, schedule: Schedule, steps: range) -> Span:
        """What a compiled loop is told of these steps, whose rows fit into the recorder's block."""
        recorder = network.recorder
        self._tables.latest[:-1] = NOWHERE
        if recorder.filled:
            self._tables.latest[:-1] = recorder.places[recorder.filled - 1]
            self._tables.newest[:] = recorder.block(recorder.filled - 1).newest
        self._tables.latest[-1] = recorder.used
        return Span(steps.start, steps.stop, schedule.start_time, schedule.step_size, recorder.every, recorder.drained,
                    recorder.words.ctypes.data, recorder.places.ctypes.data, network.method.tolerance,
                    network.method.iterations)

    def _fail(self, network: Network, schedule: Schedule, end: Any) -> None:
        """Raise what the plain algorithm would have raised."""
        instance = self._instances[end.node]
        instance.time = float(network.state.starts[end.node])
        if end.what == NOT_A_NUMBER:
            network.nodes[end.node].check(schedule.time(end.steps + 1))
        elif end.what == UNSETTLED:
            loop = next(loop for loop in network.loops if loop.first == end.node)
            raise unsettled(network, loop, schedule.time(end.steps + 1))
        elif end.what == STATE_FAILED:
            instance.fail(end.status, "its state cannot be kept or restored")
        elif end.what != STEP_FAILED:
            instance.fail(end.status, f"{self._functions[end.what]} failed")
        elif isinstance(instance, FmuInstance3):
            answer = self._tables.answers[end.node]
            instance.answer(bool(answer["ended"]), float(answer["reached"]))
            instance.fail_step(end.status)
        else:
            instance.fail(end.status, "the step failed")

    # Tables

    def _build(self, network: Network, nodes: Sequence[tuple[int, ...]]) -> Tables:
        memory, times, starts, samples, iterates, _ = network.state
        answers = np.zeros(len(nodes), ANSWER)
        answer_places = answers.ctypes.data + np.arange(len(nodes), dtype=np.uintp) * np.uintp(ANSWER.itemsize)
        newest = np.zeros(network.recorder.layout.row_words, np.int64)
        compared, pieces, runs = _stretches(network, newest.ctypes.data)
        return Tables(
            nodes=_records(nodes, NODE),
            copies=_records(self._records["copy"], COPY),
            conversions=_records(self._records["conversion"], CONVERSION),
            follows=_records(self._records["follow"], FOLLOW),
            calls=_records(self._records["call"], CALL),
            watches=_records(self._records["watch"], WATCH),
            answers=answers, answer_places=answer_places.astype(np.uintp),
            memory=Views(*(memory.view(name) for name in Views._fields)),
            times=times, starts=starts, samples=samples, stretches=compared, pieces=pieces, runs=runs,
            newest=newest, latest=np.zeros(len(pieces) + 1, np.uint64), loops=_records(network.loops, LOOP),
            iterates=iterates)

    def _node(self, node: Node, multiple: int) -> tuple[int, ...]:
        """The record of one node, after those of its parts."""
        instance = node.instance
        assert isinstance(instance, FmuInstance)
        self._instances.append(instance)
        wiring = node.wiring
        copies = [_copy(copy) for copy in wiring.copies if copy.plain]
        conversions = [self._conversion(copy) for copy in wiring.copies if not copy.plain]
        sets = [self._call(instance, C_TYPES[port.c_type].setter, port) for port in wiring.written]
        if wiring.following is not None and isinstance(instance, FmuInstance2):
            sets.append(self._derivative_call(instance, node))
        gets = [self._call(instance, C_TYPES[port.c_type].getter, port) for port in wiring.read]
        spans = [
            self._add("copy", copies), self._add("conversion", conversions),
            self._add("follow", [_follow(follow) for follow in wiring.follows]),
            self._add("call", sets), self._add("call", gets),
            self._add("watch", _watches(self._begin, wiring.watched)),
        ]
        fmi = int(instance.prefix[-1])
        do_step = function_address(instance.function("DoStep"))
        get_state, set_state, slot = 0, 0, 0
        if isinstance(node.slot, FmuSlot):
            (get_state, set_state), slot = node.slot.functions, node.slot.address
        return (fmi, instance.component, do_step, multiple, int(instance.final), get_state, set_state, slot,
                *(end for span in spans for end in span))

    def _add(self, table: str, records: Sequence[tuple[Any, ...]]) -> tuple[int, int]:
        """First and last + 1 of the rows that the records get."""
        rows = self._records[table]
        first = len(rows)
        rows.extend(records)
        return first, len(rows)

    def _conversion(self, copy: Copy) -> tuple[float, ...]:
        columns = np.array([_signed(value) for column in zip(*sorted(
            (_signed(source), target) for source, target in copy.table), strict=True) for value in column], np.int64)
        self._kept.append(columns)
        return (code(C_TYPES[copy.source_type].dtype), copy.source_index, code(C_TYPES[copy.target_type].dtype),
                copy.target_index, copy.factor, copy.shift, columns.ctypes.data, len(copy.table))

    def _call(self, instance: FmuInstance, function: str, port: Port) -> tuple[int, ...]:
        self._functions.append(function)
        counts = instance.value_count(port.values)
        return (function_address(getattr(instance.dll, function)), port.references.ctypes.data, port.references.size,
                port.values.ctypes.data, *(counts or (0,)), 4 + len(counts))

    def _derivative_call(self, instance: FmuInstance2, node: Node) -> tuple[int, ...]:
        following = node.wiring.following
        assert following is not None
        references, orders = derivative_arguments(following.port.references, following.derivatives)
        self._kept += [references, orders]
        self._functions.append("fmi2SetRealInputDerivatives")
        return (function_address(instance.dll.fmi2SetRealInputDerivatives), references.ctypes.data, references.size,
                orders.ctypes.data, following.derivatives.ctypes.data, 5)


def _stretches(network: Network, newest: int) -> tuple[Records, Records, Records]:
    """What is compared at once, what is recorded together, and the fewest runs of bytes that both consist of.

    ``newest`` is the address of the newest row. What stays as it is has no runs to compare. Pieces of values that
    change at events only are compared together, because hardly ever one of them has changed; others on their own.
    """
    begin, layout = network.octets.ctypes.data, network.recorder.layout
    runs: list[tuple[int, int, int]] = []

    def add(pieces: Sequence[Piece]) -> tuple[int, int]:
        first, width = len(runs), pieces[0].width
        inside = network.recorded[width][pieces[0].first:pieces[-1].last].tolist()
        for number, place, count in stretches(inside):
            runs.append((begin + number * width, newest + pieces[0].word * WORD + place * width, count * width))
        return first, len(runs)

    pieces = [(*add([piece]), piece.word, piece.words) for piece in layout.pieces]
    compared = []
    for first, last in layout.stretches:
        fixed = layout.pieces[first].changes == NEVER
        compared.append((first, last, *((0, 0) if fixed else add(layout.pieces[first:last]))))
    return _records(compared, STRETCH), _records(pieces, PIECE), _records(runs, RUN)


def _watches(begin: int, watched: Sequence[Watch]) -> list[tuple[int, int, int]]:
    """Values that are looked at for NaN, as stretches of the memory, which begins at this address."""
    records = []
    for dtype in {C_TYPES[watch.c_type].dtype: None for watch in watched}:
        places = sorted(watch.index for watch in watched if C_TYPES[watch.c_type].dtype == dtype)
        records += [(begin + first * dtype.itemsize, dtype.itemsize, count) for first, _, count in stretches(places)]
    return records


def _records(rows: Sequence[tuple[Any, ...]], dtype: np.dtype[Any]) -> Records:
    return np.array(list(rows), dtype)


def _copy(copy: Copy) -> tuple[int, ...]:
    return (C_TYPES[copy.source_type].dtype.itemsize, copy.source_index, copy.target_index)


def _signed(value: int) -> int:
    """The number of 64 bits with sign that has the same bits."""
    return value - 2**64 if value >= 2**63 else value


def _follow(follow: Follow) -> tuple[float, ...]:
    copy, places = follow.copy, follow.derivatives
    return (follow.number, follow.giver, copy.source_index, copy.target_index, len(places), places[0], places[-1],
            int(copy.plain), copy.factor, copy.shift)
