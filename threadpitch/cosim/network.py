"""Running instances joined by their links, through arrays that are allocated once.

Per kind of value there is one array of everything that is read from the instances and one of everything that is
written to them; each node owns a stretch of both. Recording copies from the first, links copy from the first to the
second. An algorithm only says in which order nodes receive, step and publish.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.check import Link
from threadpitch.cosim.description import FmuVariable
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.instance import DTYPES, KINDS, Instance, Transfer, Values
from threadpitch.cosim.recording import Recorder


class Node:
    """One instance with its place in the arrays."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.name = instance.name
        self.receiving: list[Transfer] = []
        self.getting: list[Transfer] = []
        self.checking: list[Transfer] = []

    def receive(self) -> None:
        """Copy what the links bring and set it as inputs."""
        for transfer in self.receiving:
            transfer()

    def get(self) -> None:
        """Get what links and recording need."""
        for transfer in self.getting:
            transfer()

    def publish(self) -> None:
        """Get, and refuse to pass on what is not a number."""
        for transfer in self.getting:
            transfer()
        for check in self.checking:
            check()


@dataclass(frozen=True)
class Exchange:
    """The values of one kind. ``written = factor * read[source] + offset``, ``row = read[recorded]``.

    ``read`` (r,) is got from the instances, ``written`` (w,) is set in them; ``source``, ``factor`` and ``offset`` are
    (w,), ``recorded`` (channels,).
    """

    read: Values
    written: Values
    source: NDArray[np.intp]
    factor: NDArray[np.float64]
    offset: NDArray[np.float64]
    recorded: NDArray[np.intp]


class Network:
    """Nodes in their order, the values between them, and what is recorded of them.

    ``time`` is the communication point that the values belong to; the algorithm keeps it up to date.
    """

    def __init__(self, instances: Sequence[Instance], links: Iterable[Link], recorder: Recorder) -> None:
        self.nodes = tuple(Node(instance) for instance in instances)
        self.recorder = recorder
        self.time = recorder.schedule.start_time
        links = tuple(links)
        self.exchanges = {kind: self._join(kind, [link for link in links if link.source.kind == kind])
                          for kind in KINDS}
        self._rows = [(exchange.read, exchange.recorded, recorder.rows[kind])
                      for kind, exchange in self.exchanges.items() if exchange.recorded.size]

    def record(self, row: int) -> None:
        """Copy the recorded values into a row."""
        for read, recorded, rows in self._rows:
            read.take(recorded, None, rows[row], "clip")  # "clip" lets NumPy write to the row without a buffer
        self.recorder.filled = row + 1

    def written_bits(self) -> bytes:
        """All values that links bring, as bits: tells whether anything changed."""
        return b"".join(exchange.written.tobytes() for exchange in self.exchanges.values())

    def _join(self, kind: str, links: Sequence[Link]) -> Exchange:
        """Lay out the arrays of one kind, stretch by stretch, and bind the nodes' transfers to them."""
        channels = self.recorder.channels[kind]
        wanted: dict[str, dict[str, FmuVariable]] = {node.name: {} for node in self.nodes}
        for channel in channels:
            wanted[channel.component][channel.variable.name] = channel.variable
        for link in links:
            wanted[link.source_component][link.source.name] = link.source
        incoming = [link for node in self.nodes for link in links if link.target_component == node.name]
        slots = [(name, variable) for name, variables in wanted.items() for variable in variables]
        slot = {key: number for number, key in enumerate(slots)}
        offset = np.array([link.offset for link in incoming])
        exchange = Exchange(
            read=np.zeros(len(slots), DTYPES[kind]),
            written=np.zeros(len(incoming), DTYPES[kind]),
            source=np.array([slot[link.source_component, link.source.name] for link in incoming], np.intp),
            factor=np.array([link.factor for link in incoming]),
            # x + (-0.0) is x for every x, a zero's sign included; x + 0.0 is not.
            offset=np.where(offset == 0.0, -0.0, offset),
            recorded=np.array([slot[channel.component, channel.variable.name] for channel in channels], np.intp),
        )
        first_read = first_written = 0
        for node in self.nodes:
            variables = tuple(wanted[node.name].values())
            targets = [link.target for link in incoming if link.target_component == node.name]
            self._bind_get(node, kind, variables, exchange.read[first_read:first_read + len(variables)])
            _bind_receive(node, kind, targets, (exchange, slice(first_written, first_written + len(targets))))
            first_read += len(variables)
            first_written += len(targets)
        return exchange

    def _bind_get(self, node: Node, kind: str, variables: Sequence[FmuVariable], values: Values) -> None:
        if not variables:
            return
        node.getting.append(node.instance.getter(kind, _references(variables), values))
        if kind != "Real":
            return

        def check() -> None:
            # A quick look first: the sum is NaN when an element is, or when infinities cancel.
            if math.isnan(sum(values.tolist())) and np.isnan(values).any():
                name = variables[int(np.flatnonzero(np.isnan(values))[0])].name
                raise StepError(f"{node.name}: {name} is not a number (NaN) at t = {self.time:.9g} s; "
                                "look at the component's inputs and parameters",
                                component=node.name, time=self.time, status="nan")

        node.checking.append(check)


def _bind_receive(node: Node, kind: str, targets: Sequence[FmuVariable], place: tuple[Exchange, slice]) -> None:
    if not targets:
        return
    exchange, stretch = place
    read, written, source = exchange.read, exchange.written[stretch], exchange.source[stretch]
    factor, offset = exchange.factor[stretch], exchange.offset[stretch]
    set_inputs = node.instance.setter(kind, _references(targets), written)

    def copy() -> None:
        read.take(source, None, written, "clip")

    def copy_converted() -> None:
        read.take(source, None, written, "clip")
        np.multiply(written, factor, written)
        np.add(written, offset, written)

    converts = bool(np.any(factor != 1.0) or np.any(offset != 0.0))
    node.receiving += [copy_converted if converts else copy, set_inputs]


def _references(variables: Sequence[FmuVariable]) -> NDArray[np.uint32]:
    return np.array([variable.reference for variable in variables], np.uint32)
