"""Where every value of a network lies in its memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.block import Channel
from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.check import Link
from threadpitch.cosim.memory import Memory, Port, space
from threadpitch.cosim.method import Method
from threadpitch.cosim.variable import FmuVariable

_REAL = np.dtype(np.float64)
_Wanted = dict[str, dict[int, int]]  # by C type, by value reference: the number of values


@dataclass(frozen=True)
class FollowingPort:
    """Inputs that follow polynomials: their values, and ``derivatives`` (order, n), which begin at a byte too."""

    port: Port
    derivatives: NDArray[np.float64]
    offset: int


class Layout:
    """By component: the ports of what is read once, of what is read after every step, of what is written and held, and
    of what is written and followed.
    """

    def __init__(self, names: Sequence[str], links: Iterable[Link], channels: Iterable[Channel],
                 method: Method) -> None:
        read: dict[str, _Wanted] = {name: {} for name in names}
        fixed: dict[str, _Wanted] = {name: {} for name in names}
        held: dict[str, _Wanted] = {name: {} for name in names}
        followed: dict[str, _Wanted] = {name: {} for name in names}
        for channel in channels:
            _want((fixed if channel.variable.fixed else read)[channel.component], channel.variable)
        for link in links:
            _want(read[link.source_component], link.source)
            _forget(fixed[link.source_component], link.source)
            _want((followed if method.follows(link) else held)[link.target_component], link.target)
        for name in names:
            _leave_arrays_whole(held[name], followed[name])
        groups = (*fixed.values(), *read.values(), *held.values(), *followed.values())
        self.memory = Memory(_size(groups, method, followed))
        self._places: dict[tuple[str, str, str, int], int] = {}
        self.fixed = {name: self._ports("read", name, wanted) for name, wanted in fixed.items()}
        self.read = {name: self._ports("read", name, wanted) for name, wanted in read.items()}
        self.held = {name: self._ports("written", name, wanted) for name, wanted in held.items()}
        self.followed = {name: self._following(name, wanted, method.order(name))
                         for name, wanted in followed.items() if wanted}

    def source(self, component: str, variable: FmuVariable) -> int:
        """The byte where a value that is read begins."""
        return self._byte("read", component, variable)

    def target(self, component: str, variable: FmuVariable) -> int:
        """The byte where a value that is written begins."""
        return self._byte("written", component, variable)

    def _byte(self, way: str, component: str, variable: FmuVariable) -> int:
        width = C_TYPES[variable.c_type].dtype.itemsize
        return self._places[way, component, variable.c_type, variable.reference] + variable.element * width

    def _ports(self, way: str, name: str, wanted: _Wanted) -> tuple[Port, ...]:
        ports = []
        for c_type, variables in wanted.items():
            port = self.memory.port(c_type, variables)
            place = port.offset
            for reference, size in variables.items():
                self._places[way, name, c_type, reference] = place
                place += size * C_TYPES[c_type].dtype.itemsize
            ports.append(port)
        return tuple(ports)

    def _following(self, name: str, wanted: _Wanted, order: int) -> FollowingPort:
        port, = self._ports("written", name, wanted)
        offset, derivatives = self.memory.stretch(_REAL, order * port.values.size)
        return FollowingPort(port, derivatives.reshape(order, port.values.size), offset)


def _want(wanted: _Wanted, variable: FmuVariable) -> None:
    wanted.setdefault(variable.c_type, {})[variable.reference] = variable.size


def _forget(wanted: _Wanted, variable: FmuVariable) -> None:
    found = wanted.get(variable.c_type, {})
    found.pop(variable.reference, None)
    if variable.c_type in wanted and not found:
        del wanted[variable.c_type]


def _leave_arrays_whole(held: _Wanted, followed: _Wanted) -> None:
    """An array is set as a whole: where one element follows, those that are held do so with derivatives of zero."""
    for c_type, variables in followed.items():
        for reference in variables:
            held.get(c_type, {}).pop(reference, None)
        if c_type in held and not held[c_type]:
            del held[c_type]


def _size(groups: Iterable[_Wanted], method: Method, followed: dict[str, _Wanted]) -> int:
    values = sum(space(C_TYPES[c_type].dtype, sum(variables.values()))
                 for wanted in groups for c_type, variables in wanted.items())
    derivatives = sum(space(_REAL, method.order(name) * sum(variables.values()))
                      for name, wanted in followed.items() for variables in wanted.values())
    return values + derivatives
