"""A system as it is written: nested blocks, each with its components, connectors and wires."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from threadpitch.cosim.system import Component, Connector, ParameterValue, Transformation


@dataclass(frozen=True)
class End:
    """One end of a connection inside of a block; an empty element stands for the block itself."""

    element: str
    connector: str
    indices: tuple[int, ...] = ()


@dataclass(frozen=True)
class Wire:
    """A connection as it is written: which way the data go depends on the connectors."""

    start: End
    end: End
    transformation: Transformation
    origin: str


@dataclass(frozen=True)
class Reference:
    """An element that gives access to a signal dictionary: all connectors of one name carry one signal."""

    name: str
    dictionary: str
    connectors: tuple[Connector, ...]
    origin: str


@dataclass(frozen=True)
class Block:
    """A system, the outermost or a nested one.

    Names are those within it; but components have their full names, ``system.component``. ``elements`` stand in the
    order of the file, ``values`` are those of everything in it, the ones that take precedence last.
    """

    name: str
    connectors: tuple[Connector, ...] = ()
    elements: tuple[Component | Block | Reference, ...] = ()
    dictionaries: Mapping[str, Mapping[str, Connector]] = field(default_factory=dict)
    wires: tuple[Wire, ...] = ()
    values: tuple[ParameterValue, ...] = ()
