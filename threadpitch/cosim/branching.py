"""The common beginning of runs is computed once: a run whose parameters change nothing of it branches off later.

What a run shares with a former one is not assumed, it is looked at. The run is initialised like any other. Components
whose values have changed are computed with the inputs that they had in the former run, step by step; as long as
what they give to the others stays the same bit for bit, the others are in the states of the former run, and theirs are
restored where it was left. So the bits are those of a run from the beginning.
"""

from __future__ import annotations

import functools
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import Channel
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import SimulationInterrupted
from threadpitch.cosim.interrupt import HeldInterrupt
from threadpitch.cosim.network import Network
from threadpitch.cosim.node import Node
from threadpitch.cosim.plan import Setting
from threadpitch.cosim.program import Program
from threadpitch.cosim.replay import Script, replay, stretches, traced
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.state_slot import FmuSlot
from threadpitch.cosim.system import Value
from threadpitch.cosim.tables import DONE, End

Values = Mapping[tuple[str, str], Value]  # by component and variable

KEPT = 4  # beginnings of former runs
CHUNK = 32  # steps between two states: so much may be computed once more
LONGEST = 8192  # steps of a beginning
_TRIALS = 3  # failures after which a set of parameters is taken to change the beginning


@dataclass
class Beginning:
    """A run up to a step before the one at which runs part.

    ``trace`` (steps + 1, bytes) is the memory after initialisation and after every step, ``arrays`` what else nodes
    share, ``slots`` the nodes' states after the last step.
    """

    slots: list[FmuSlot]
    steps: int = 0
    values: Values = field(default_factory=dict)
    trace: NDArray[np.uint8] = field(default_factory=lambda: np.empty((0, 0), np.uint8))
    arrays: tuple[NDArray[Any], ...] = ()


class Branching:
    """Beginnings of former runs of one network; ``mark`` is the truth value before whose first row runs part."""

    def __init__(self, network: Network, schedule: Schedule, mark: Channel) -> None:
        self._network = network
        self._schedule = schedule
        first = network.source(mark.component, mark.variable)
        self._mark = slice(first, first + mark.width)  # bytes of the memory
        rows = min(LONGEST, schedule.steps, network.recorder.times.size - 1) // CHUNK * CHUNK + 1
        self._trace = np.empty((rows, network.octets.size), np.uint8)
        # All slots are taken before the programs are made, which tell the FMUs whether the master may step back.
        spare = [[node.instance.slot() for node in network.nodes] for _ in range(KEPT + 1)]
        self._spare = [Beginning([slot for slot in slots if isinstance(slot, FmuSlot)]) for slots in spare]
        self._kept: deque[Beginning] = deque()
        self._failures: dict[frozenset[tuple[str, str]], int] = {}
        self._own = [_bytes_of(node, network.octets.size) for node in network.nodes]
        self._given = _given_bytes(network.nodes, network.octets.size)
        self.branched = 0  # runs that began behind step 0
        self.touched = False

    def begin(self, program: Program, settings: Iterable[Setting]) -> bool:
        """Bring the initialised network to where it branches off from a former run, and record the steps up to there.

        False where it shares nothing with one. Then ``touched`` tells whether it has to be initialised anew.
        """
        values, self.touched = _values(settings), False
        for beginning in self._kept:
            changed = frozenset(name for name in beginning.values.keys() | values.keys()
                                if beginning.values.get(name) != values.get(name))
            if self._failures.get(changed, 0) < _TRIALS:
                if self._branch(program, beginning, {component for component, _ in changed}):
                    self._kept.remove(beginning)
                    self._kept.appendleft(beginning)
                    self._failures.pop(changed, None)
                    self.branched += 1
                    return True
                self._failures[changed] = self._failures.get(changed, 0) + 1
                return False
        return False

    def compute(self, program: Program, settings: Iterable[Setting]) -> None:
        """Compute the beginning of the initialised network, and keep it for others.

        Raises:
            StepError: a component fails.
            SimulationInterrupted: Ctrl-C was pressed, or SIGTERM or SIGHUP came.
        """
        with HeldInterrupt() as interrupt:
            self._compute(program, settings, interrupt)

    def _compute(self, program: Program, settings: Iterable[Setting], interrupt: HeldInterrupt) -> None:
        network, schedule = self._network, self._schedule
        memory, row = network.octets, self._trace.shape[1]
        loop = functools.partial(traced, trace=self._trace.ctypes.data, size=row, memory=memory.ctypes.data)
        beginning = self._spare.pop() if self._spare else self._kept.pop()
        beginning.values = _values(settings)
        self._trace[0] = network.octets
        done = 0
        while True:
            for slot in beginning.slots:
                slot.save()
            beginning.steps, beginning.arrays = done, tuple(array.copy() for array in self._shared())
            if done + CHUNK >= self._trace.shape[0] or done + CHUNK >= schedule.steps:
                break
            program.compute(network, schedule, range(done, done + CHUNK), loop)
            done += CHUNK
            if interrupt.requested:
                raise SimulationInterrupted(schedule.time(done), interrupt.signal)
            if self._marked(done):
                break
        beginning.trace = _copied(self._trace[:beginning.steps + 1], beginning.trace)
        self._kept.appendleft(beginning)
        if len(self._kept) > KEPT:
            self._spare.append(self._kept.pop())

    def _marked(self, done: int) -> bool:
        """Whether runs part in the last chunk."""
        return bool(self._trace[done - CHUNK:done + 1, self._mark].any())

    def _branch(self, program: Program, beginning: Beginning, changed: set[str]) -> bool:
        network, schedule, steps = self._network, self._schedule, beginning.steps
        numbers = [node.number for node in network.nodes if node.name in changed]
        own = np.zeros(network.octets.size, np.bool_)
        for number in numbers:
            own |= self._own[number]
        given = own & self._given
        if not np.array_equal(network.octets[~own | given], beginning.trace[0][~own | given]):
            return False
        nodes = np.array(numbers, np.int64)
        taken, compared = stretches(~own, np.uint64), stretches(given, np.int64)
        script = Script(beginning.trace.ctypes.data, network.octets.size, network.octets.ctypes.data,
                        nodes.ctypes.data, nodes.size, taken.ctypes.data, len(taken), compared.ctypes.data,
                        len(compared))
        self.touched = True
        if End(*replay(program.places, program.span(network, schedule, range(steps)), script)).what != DONE:
            return False
        for node, slot in zip(network.nodes, beginning.slots, strict=True):
            if node.name not in changed:
                slot.restore()
        for array, kept in zip(self._shared(), beginning.arrays, strict=True):
            np.copyto(array, kept)
        network.recorder.advance(steps, program.used)
        return True

    def _shared(self) -> tuple[NDArray[Any], ...]:
        """What nodes share besides the memory."""
        state = self._network.state
        return (state.times, state.starts, *state.samples, *state.iterates, state.control)


def _copied(rows: NDArray[np.uint8], room: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The rows in the memory of a former trace where they fit: to touch fresh memory takes longer than to copy."""
    whole = room if room.base is None else room.base
    if whole.shape[0] < rows.shape[0]:
        return rows.copy()
    np.copyto(whole[:rows.shape[0]], rows)
    return np.asarray(whole[:rows.shape[0]])


def _values(settings: Iterable[Setting]) -> Values:
    return {(found.component, found.variable.name): found.value for found in settings}


def _bytes_of(node: Node, size: int) -> NDArray[np.bool_]:
    """(size,) the bytes of the memory that this node fills."""
    mask = np.zeros(size, np.bool_)
    for port in (*node.wiring.fixed, *node.wiring.read):
        mask[port.offset:port.offset + port.values.nbytes] = True
    return mask


def _given_bytes(nodes: Iterable[Node], size: int) -> NDArray[np.bool_]:
    """(size,) the bytes of the memory that links take from."""
    mask = np.zeros(size, np.bool_)
    for node in nodes:
        for copy in (*node.wiring.copies, *(follow.copy for follow in node.wiring.follows)):
            mask[copy.source:copy.source + C_TYPES[copy.source_type].dtype.itemsize] = True
    return mask
