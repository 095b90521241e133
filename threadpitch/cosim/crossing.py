"""Crossings of a level: found between two communication points, and located in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scipy.optimize import brentq

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.events import Event, Level
from threadpitch.cosim.network import Network


@dataclass(frozen=True)
class Crossing:
    """An event of a network: the variable's values are numbers at one place of its memory."""

    event: Event
    level: float
    value: Callable[[], float]

    def passed(self, before: float, after: float) -> str:
        """The direction in which the level was passed, or nothing."""
        if before < self.level <= after and self.event.direction != "falling":
            return "rising"
        if before > self.level >= after and self.event.direction != "rising":
            return "falling"
        return ""


def crossings(network: Network) -> tuple[Crossing, ...]:
    """The events of a network, joined to its memory."""
    return tuple(Crossing(found.event, found.level, _reader(network, found)) for found in network.levels)


def _reader(network: Network, found: Level) -> Callable[[], float]:
    dtype = C_TYPES[found.variable.c_type].dtype
    values = network.state.memory.view(dtype)
    place = network.source(found.component, found.variable) // dtype.itemsize
    return lambda: float(values[place])


def locate(distance: Callable[[float], float], ends: tuple[float, float], size: float, tolerance: float) -> float:
    """The part of a step of this size after which a level is passed, at most a tolerance late.

    ``distance(part)`` is the variable less its level after that part, ``ends`` what it is at the beginning and the end
    of the step. Brent's method.
    """
    known = {0.0: ends[0], size: ends[1]}

    def measured(part: float) -> float:
        if part not in known:
            known[part] = distance(part)
        return known[part]

    if ends[1] == 0.0:
        return size
    part = float(brentq(measured, 0.0, size, xtol=0.1 * tolerance, rtol=1e-15))
    late = part
    while late < size and measured(late) * ends[0] > 0.0:
        late += 0.1 * tolerance
    return min(late, size)
