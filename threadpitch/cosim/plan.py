"""A checked system: links between variables and values to set, ready to be instantiated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.system import System, Value
from threadpitch.cosim.variable import FmuVariable


@dataclass(frozen=True)
class Link:
    """``target = factor * source + offset``, each in its FMU's own unit.

    Of whole numbers and truth values ``table`` holds the pairs (source, target) that differ; the rest is unchanged.
    """

    source_component: str
    source: FmuVariable
    target_component: str
    target: FmuVariable
    factor: float = 1.0
    offset: float = 0.0
    table: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class Setting:
    """A value that a component's variable takes before initialisation, in the variable's unit.

    ``starts`` are the start values of all elements where the variable is one of an FMI 3.0 array's.
    """

    component: str
    variable: FmuVariable
    value: Value
    starts: tuple[float, ...] = ()


@dataclass(frozen=True)
class Plan:
    """A checked system, ready to be instantiated.

    ``order`` is the order of the data, ``loops`` the groups of components that feed each other; ``notes`` tells what
    was passed over (values of a parameter set that name nothing in the system, which SSP says to ignore).
    """

    system: System
    descriptions: Mapping[str, FmuDescription]  # by component
    links: tuple[Link, ...]
    settings: tuple[Setting, ...]
    order: tuple[str, ...]
    loops: tuple[tuple[str, ...], ...] = ()
    notes: tuple[str, ...] = ()
