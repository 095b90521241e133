"""One instance in a network: what it receives, steps and publishes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.extrapolation import Samples, add_sample, polynomial
from threadpitch.cosim.instance import Instance, Polynomials, References, Transfer, Values
from threadpitch.cosim.iteration import Iterates
from threadpitch.cosim.layout import FollowingPort
from threadpitch.cosim.memory import Memory, Port
from threadpitch.cosim.state_slot import Slot


@dataclass(frozen=True)
class Copy:
    """``target = factor * source + offset``, values of two C types at two bytes of the memory.

    ``table`` holds pairs (source, target) of whole numbers and truth values; what is not in it stays.
    """

    source_type: str
    source: int
    target_type: str
    target: int
    factor: float = 1.0
    offset: float = 0.0
    table: tuple[tuple[int, int], ...] = ()

    @property
    def plain(self) -> bool:
        """Whether the bits are copied as they are."""
        same = C_TYPES[self.source_type].dtype == C_TYPES[self.target_type].dtype
        return same and (self.factor, self.offset) == (1.0, 0.0) and not self.table

    @property
    def source_index(self) -> int:
        """The number of the source's value among those of its type."""
        return self.source // C_TYPES[self.source_type].dtype.itemsize

    @property
    def target_index(self) -> int:
        """The number of the target's value among those of its type."""
        return self.target // C_TYPES[self.target_type].dtype.itemsize

    @property
    def shift(self) -> float:
        """The offset to add: x + (-0.0) is x for every x, a zero's sign included; x + 0.0 is not."""
        return -0.0 if self.offset == 0.0 else self.offset


@dataclass(frozen=True)
class Follow:
    """An input that follows its source: the copy that would hold it, and its place among the samples.

    ``giver`` is the source's node, ``derivatives`` the numbers of the input's derivatives among the Real values.
    """

    copy: Copy
    number: int
    giver: int
    derivatives: tuple[int, ...]


@dataclass(frozen=True)
class Watch:
    """A Real output that is looked at for NaN."""

    c_type: str
    byte: int
    name: str

    @property
    def index(self) -> int:
        """Its number among the values of its type."""
        return self.byte // C_TYPES[self.c_type].dtype.itemsize


@dataclass(frozen=True)
class Wiring:
    """What joins a node to the memory."""

    fixed: tuple[Port, ...] = ()  # read once
    read: tuple[Port, ...] = ()
    written: tuple[Port, ...] = ()  # all, that which follows included
    following: FollowingPort | None = None
    copies: tuple[Copy, ...] = ()
    follows: tuple[Follow, ...] = ()
    watched: tuple[Watch, ...] = ()


class State(NamedTuple):
    """What the nodes of a network share, and the kernel works on.

    By node: ``times`` (nodes,) the communication points that the outputs belong to, ``starts`` (nodes,) where the last
    step began, seconds. ``samples`` are the newest values of what inputs follow, ``iterates`` what loops that are
    iterated feed back. ``control`` holds the step size [s] that was found good last and its error over the allowed one
    (zeros before), then the largest absolute value so far of every Real value that links bring.
    """

    memory: Memory
    times: NDArray[np.float64]
    starts: NDArray[np.float64]
    samples: Samples
    iterates: Iterates
    control: NDArray[np.float64]


class Node:
    """One instance, number ``number`` of the network; ``slot`` holds its state where steps are repeated."""

    def __init__(self, instance: Instance, number: int, wiring: Wiring, state: State) -> None:
        self.instance = instance
        self.name = instance.name
        self.number = number
        self.wiring = wiring
        self.slot: Slot | None = None
        self._state = state
        self._getting = [_bound(instance.getter, port) for port in wiring.read]
        self._fixing = [_bound(instance.getter, port) for port in wiring.fixed]
        self._priming = [_bound(instance.getter, port) for port in wiring.written
                         if port.values.size > port.references.size]
        self._copying = copiers(state.memory, wiring.copies)
        self._holding = copiers(state.memory, [follow.copy for follow in wiring.follows])
        self._setting = [_bound(instance.setter, port) for port in wiring.written]
        self._following: list[Transfer] = list(self._setting)
        if wiring.following is not None:
            port = wiring.following.port
            start = state.starts[number:number + 1]
            polynomials = Polynomials(port.values, wiring.following.derivatives, start)
            self._following = [_bound(instance.setter, held) for held in wiring.written if held is not port]
            self._following.append(instance.follower(port.c_type, port.references, polynomials))

    # Initialisation

    def prime(self) -> None:
        """Get the arrays of inputs: links may feed some of their elements only."""
        for transfer in self._priming:
            transfer()

    def hold(self) -> None:
        """Copy what the links bring and set it as inputs, without extrapolation."""
        for transfer in (*self._copying, *self._holding, *self._setting):
            transfer()

    def get(self) -> None:
        """Get what links and recording need."""
        for transfer in self._getting:
            transfer()

    def settle(self) -> None:
        """Get what stays as it is from the end of initialisation on."""
        for transfer in self._fixing:
            transfer()

    # Steps

    def sample(self) -> None:
        """Note the newest values of what inputs follow, with the time that they belong to."""
        memory, times, samples = self._state.memory, self._state.times, self._state.samples
        for follow in self.wiring.follows:
            value = float(memory.view(np.float64)[follow.copy.source_index])
            if not follow.copy.plain:
                value = value * follow.copy.factor + follow.copy.shift
            add_sample(samples, follow.number, float(times[follow.giver]), value)

    def receive(self, start: float) -> None:
        """Set what the links bring as inputs of the step that begins at ``start``."""
        for transfer in self._copying:
            transfer()
        self.sample()
        reals = self._state.memory.view(np.float64)
        for follow in self.wiring.follows:
            order = len(follow.derivatives)
            value, *derivatives = polynomial(self._state.samples, follow.number, order, start)
            reals[follow.copy.target_index] = value
            reals[list(follow.derivatives)] = derivatives[:order]
        self._state.starts[self.number] = start
        for transfer in self._following:
            transfer()

    def step(self, start: float, step_size: float) -> None:
        """Compute from ``start`` on."""
        self._state.starts[self.number] = start
        self.instance.do_step(start, step_size)

    def save(self) -> None:
        """Keep the instance's state, before a step that may be repeated."""
        if self.slot is not None:
            self.slot.save()

    def restore(self) -> None:
        """Go back to the state that was kept."""
        if self.slot is not None:
            self.slot.restore()

    def publish(self, time: float) -> None:
        """Get what links and recording need, and refuse to pass on what is not a number; all belongs to ``time``."""
        for transfer in self._getting:
            transfer()
        self._state.times[self.number] = time
        self.check(time)

    def check(self, time: float) -> None:
        """Look at the Real outputs.

        Raises:
            StepError: one is NaN.
        """
        for port in self.wiring.read:
            # A quick look first: the sum is NaN when an element is, or when infinities cancel.
            if port.values.dtype.kind == "f" and math.isnan(sum(port.values.tolist())):
                self._name_nan(time)

    def _name_nan(self, time: float) -> None:
        for watch in self.wiring.watched:
            if np.isnan(self._state.memory.view(C_TYPES[watch.c_type].dtype)[watch.index]):
                raise StepError(f"{self.name}: {watch.name} is not a number (NaN) at t = {time:.9g} s; "
                                "look at the component's inputs and parameters",
                                component=self.name, time=time, status="nan")


def copiers(memory: Memory, copies: Sequence[Copy]) -> list[Transfer]:
    """The calls that do the copies: one for all that have the same types, and are plain or not; one for each table."""
    tabled = [_by_table(memory, copy) for copy in copies if copy.table]
    copies = [copy for copy in copies if not copy.table]
    groups: dict[tuple[np.dtype[Any], np.dtype[Any], bool], list[Copy]] = {}
    for copy in copies:
        dtypes = C_TYPES[copy.source_type].dtype, C_TYPES[copy.target_type].dtype
        groups.setdefault((*dtypes, copy.plain), []).append(copy)
    return tabled + [_copier(memory.view(source), memory.view(target), group)
                     for (source, target, _), group in groups.items()]


def _by_table(memory: Memory, copy: Copy) -> Transfer:
    sources = memory.view(C_TYPES[copy.source_type].dtype)
    targets = memory.view(C_TYPES[copy.target_type].dtype)
    source, target, table = copy.source_index, copy.target_index, dict(copy.table)

    def look_up() -> None:
        value = int(sources[source])
        targets[target] = table.get(value, value)

    return look_up


def _copier(sources: NDArray[Any], targets: NDArray[Any], group: Sequence[Copy]) -> Transfer:
    source = np.array([copy.source_index for copy in group], np.intp)
    target = np.array([copy.target_index for copy in group], np.intp)
    factor = np.array([copy.factor for copy in group])
    shift = np.array([copy.shift for copy in group])

    def copy_plain() -> None:
        targets[target] = sources[source]

    def convert() -> None:
        targets[target] = sources[source].astype(np.float64) * factor + shift

    linear = any((copy.factor, copy.offset) != (1.0, 0.0) for copy in group)
    return convert if linear else copy_plain


def _bound(bind: Callable[[str, References, Values], Transfer], port: Port) -> Transfer:
    return bind(port.c_type, port.references, port.values)
