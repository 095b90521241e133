"""Running instances joined by their links, through memory that is allocated once.

What is read from the instances and what is written to them lie in one memory; each node owns a stretch of it for every
kind of value. Links copy within the memory, recording copies from it. An algorithm only says in which order nodes
receive, step and publish.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import WIDTHS, Channel
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.check import Link
from threadpitch.cosim.events import Level
from threadpitch.cosim.extrapolation import Samples
from threadpitch.cosim.instance import Instance
from threadpitch.cosim.iteration import Iterates, Loop
from threadpitch.cosim.layout import Layout
from threadpitch.cosim.method import Method
from threadpitch.cosim.node import Copy, Follow, Node, State, Watch, Wiring
from threadpitch.cosim.order import find_loops
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.variable import FmuVariable


class Network:
    """Nodes in their order, the values between them, and what is recorded of them.

    ``multiples`` (nodes,) counts the communication steps that each node's own step takes, ``loops`` are the stretches
    of nodes that feed each other; ``reals`` and ``octets`` are the memory, as Real values and as bytes.
    """

    def __init__(self, instances: Sequence[Instance], links: Iterable[Link], recorder: Recorder,
                 method: Method | None = None, levels: Sequence[Level] = ()) -> None:
        self.method = Method() if method is None else method
        self.recorder = recorder
        self.levels = tuple(levels)
        self._links = tuple(links)
        self._names = [instance.name for instance in instances]
        watched = [Channel(found.component, found.variable) for found in levels]
        # In the order of the rows: what lies side by side in both is compared and copied at once.
        recorded = [found for width in WIDTHS for found in recorder.by_width[width]]
        self._layout = Layout(self._names, self._links, [*recorded, *watched], self.method)
        start = recorder.schedule.start_time
        followed = sum(map(self.method.follows, self._links))
        self.loops, iterates = self._find_loops()
        self.state = State(self._layout.memory, np.full(len(self._names), start), np.full(len(self._names), start),
                           Samples.of(followed), iterates, np.zeros(2 + self.coupled_reals().size))
        self.reals, self.octets = self.state.memory.view(np.float64), self.state.memory.view(np.uint8)
        self.multiples = [self.method.multiples.get(name, 1) for name in self._names]
        wirings = self._wirings()
        self.nodes = tuple(Node(instance, number, wirings[instance.name], self.state)
                           for number, instance in enumerate(instances))
        for node in self._repeated():
            node.slot = node.instance.slot()
        self.recorded = {width: np.array([self._layout.source(found.component, found.variable) // width
                                          for found in recorder.by_width[width]], np.intp) for width in WIDTHS}
        self._recorded = [(self.state.memory.view(f"i{width}"), self.recorded[width], width)
                          for width in WIDTHS if self.recorded[width].size]

    def due(self, step: int) -> list[Node]:
        """The nodes, in order, that have a communication point where step number ``step`` begins."""
        return [node for node, multiple in zip(self.nodes, self.multiples, strict=True) if step % multiple == 0]

    def record(self, step: int) -> None:
        """Copy the recorded values into the row of the point where step number ``step`` begins, if it has one."""
        self.recorder.steps = step
        if step % self.recorder.every == 0:
            self.record_between(self.recorder.schedule.time(step))

    def written_bits(self) -> bytes:
        """All values that links bring, as bits: tells whether anything changed."""
        return b"".join(port.values.tobytes() for node in self.nodes for port in node.wiring.written)

    def _repeated(self) -> Iterator[Node]:
        """The nodes that go back to kept states in every step."""
        if self.method.coupling == "iterated":
            for loop in self.loops:
                yield from self.nodes[loop.first:loop.last]
        else:
            yield from (node for node in self.nodes if node.name in self.method.feedthrough)

    def record_between(self, time: float) -> None:
        """Copy the recorded values into a row of a point that is not one of the schedule's."""
        row = self.recorder.add(time)
        for memory, recorded, width in self._recorded:
            # "clip" lets NumPy write to the row without a buffer.
            memory.take(recorded, None, self.recorder.rows[width][row], "clip")

    def source(self, component: str, variable: FmuVariable) -> int:
        """The byte of the memory where a value that links or recording need begins."""
        return self._layout.source(component, variable)

    def coupled_reals(self) -> NDArray[np.intp]:
        """The numbers of the Real values that links bring, among those of the memory."""
        found = {self._layout.source(link.source_component, link.source) for link in self._links
                 if C_TYPES[link.source.c_type].dtype == np.float64}
        return np.array(sorted(found), np.intp) // np.dtype(np.float64).itemsize

    def _find_loops(self) -> tuple[tuple[Loop, ...], Iterates]:
        """The loops in their order, and what runs backwards in them."""
        number = {name: place for place, name in enumerate(self._names)}
        edges = [(link.source_component, link.target_component) for link in self._links]
        spans: list[tuple[int, int]] = []  # those that reach into each other are one
        for found in find_loops(self._names, edges):
            span = min(map(number.__getitem__, found)), max(map(number.__getitem__, found)) + 1
            while spans and span[0] < spans[-1][1]:
                before = spans.pop()
                span = min(span[0], before[0]), max(span[1], before[1])
            spans.append(span)
        values: list[int] = []
        octets: list[int] = []
        loops = []
        for first, last in spans:
            begin = len(values), len(octets)
            back = [link for link in self._links
                    if first <= number[link.target_component] <= number[link.source_component] < last]
            for byte, c_type in sorted({(self._layout.source(link.source_component, link.source), link.source.c_type)
                                        for link in back}):
                dtype = C_TYPES[c_type].dtype
                if dtype == np.float64:
                    values.append(byte // dtype.itemsize)
                else:
                    octets += range(byte, byte + dtype.itemsize)
            loops.append(Loop(first, last, begin[0], len(values), begin[1], len(octets)))
        return tuple(loops), Iterates.of(values, octets)

    def _wirings(self) -> dict[str, Wiring]:
        layout = self._layout
        copies: dict[str, list[Copy]] = {name: [] for name in self._names}
        follows: dict[str, list[Follow]] = {name: [] for name in self._names}
        number = 0
        for link in self._links:
            if self.method.follows(link):
                follows[link.target_component].append(self._follow(link, number))
                number += 1
            else:
                copies[link.target_component].append(self._copy(link))
        wirings = {}
        for name in self._names:
            following = layout.followed.get(name)
            wirings[name] = Wiring(
                fixed=layout.fixed[name],
                read=layout.read[name],
                written=layout.held[name] + (() if following is None else (following.port,)),
                following=following,
                copies=tuple(copies[name]),
                follows=tuple(follows[name]),
                watched=tuple(self._watched(name)),
            )
        return wirings

    def _copy(self, link: Link) -> Copy:
        return Copy(link.source.c_type, self._layout.source(link.source_component, link.source),
                    link.target.c_type, self._layout.target(link.target_component, link.target),
                    link.factor, link.offset, link.table)

    def _follow(self, link: Link, number: int) -> Follow:
        following = self._layout.followed[link.target_component]
        copy = self._copy(link)
        place = (copy.target - following.port.offset) // 8
        order, size = following.derivatives.shape
        first = following.offset // 8 + place
        return Follow(copy, number, self._names.index(link.source_component),
                      tuple(first + size * one for one in range(order)))

    def _watched(self, name: str) -> list[Watch]:
        variables = {found.variable.name: found.variable for found in self.recorder.channels if found.component == name}
        variables |= {link.source.name: link.source for link in self._links if link.source_component == name}
        return [Watch(found.c_type, self._layout.source(name, found), found.name) for found in variables.values()
                if C_TYPES[found.c_type].family == "Real" and not found.fixed]
