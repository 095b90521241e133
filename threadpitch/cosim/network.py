"""Running instances joined by their links, through memory that is allocated once.

What is read from the instances and what is written to them lie in one memory; each node owns a stretch of it for every
kind of value. Links copy within the memory, recording copies from it. An algorithm only says in which order nodes
receive, step and publish.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.check import Link
from threadpitch.cosim.extrapolation import Samples
from threadpitch.cosim.instance import Instance
from threadpitch.cosim.layout import Layout
from threadpitch.cosim.method import Method
from threadpitch.cosim.node import Copy, Follow, Node, State, Watch, Wiring
from threadpitch.cosim.recording import WIDTHS, Recorder


class Network:
    """Nodes in their order, the values between them, and what is recorded of them.

    ``multiples`` (nodes,) counts the communication steps that each node's own step takes.
    """

    def __init__(self, instances: Sequence[Instance], links: Iterable[Link], recorder: Recorder,
                 method: Method | None = None) -> None:
        self.method = Method() if method is None else method
        self.recorder = recorder
        self._links = tuple(links)
        self._names = [instance.name for instance in instances]
        self._layout = Layout(self._names, self._links, recorder.channels, self.method)
        start = recorder.schedule.start_time
        followed = sum(map(self.method.follows, self._links))
        self.state = State(self._layout.memory, np.full(len(self._names), start), np.full(len(self._names), start),
                           Samples.of(followed))
        self.multiples = [self.method.multiples.get(name, 1) for name in self._names]
        wirings = self._wirings()
        self.nodes = tuple(Node(instance, number, wirings[instance.name], self.state)
                           for number, instance in enumerate(instances))
        self.recorded = {width: np.array([self._layout.source(found.component, found.variable) // width
                                          for found in recorder.by_width[width]], np.intp) for width in WIDTHS}
        self._rows = [(self.state.memory.view(f"i{width}"), self.recorded[width], recorder.rows[width])
                      for width in WIDTHS if self.recorded[width].size]

    def due(self, step: int) -> list[Node]:
        """The nodes, in order, that have a communication point where step number ``step`` begins."""
        return [node for node, multiple in zip(self.nodes, self.multiples, strict=True) if step % multiple == 0]

    def record(self, step: int) -> None:
        """Copy the recorded values into the row of the point where step number ``step`` begins, if it has one."""
        self.recorder.steps = step
        row, rest = divmod(step, self.recorder.every)
        if rest == 0:
            for memory, recorded, rows in self._rows:
                memory.take(recorded, None, rows[row], "clip")  # "clip" lets NumPy write to the row without a buffer
            self.recorder.filled = row + 1

    def written_bits(self) -> bytes:
        """All values that links bring, as bits: tells whether anything changed."""
        return b"".join(port.values.tobytes() for node in self.nodes for port in node.wiring.written)

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
                    link.factor, link.offset)

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
                if C_TYPES[found.c_type].family == "Real"]
