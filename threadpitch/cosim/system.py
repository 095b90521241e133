"""A system of FMUs as plain values: components, connections and parameter values, as an SSD states them.

Nothing here opens a file or loads an FMU; ``ssp`` reads a system, ``check`` compares it with its FMUs.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TypeAlias

from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.temporary_folder import TemporaryFolder
from threadpitch.units import Unit

Value: TypeAlias = float | int | bool | str


class SystemStructureError(CosimError):
    """The system cannot be built as described; ``problems`` holds every reason, the message the first one."""

    def __init__(self, *problems: str) -> None:
        self.problems = problems
        more = f" (and {len(problems) - 1} more problem{'s' if len(problems) > 2 else ''})" if len(problems) > 1 else ""
        super().__init__(problems[0] + more)


@dataclass(frozen=True)
class Connector:
    """What an SSD says of one variable of a component, or of the system itself.

    ``kind`` is the SSP word ("input", "output", "parameter", ...), ``type`` "Real", "Integer", "Boolean", "String",
    "Enumeration", a word of SSP 2.0 ("Float64", "Int32", ...) or None, ``unit`` the unit of the values that pass
    through it, None for that of the FMU's variable. ``shape`` are the extents of an array, None where one is not
    stated; ``definition`` and ``choices`` what its file says of the unit and of the enumeration.
    """

    name: str
    kind: str
    type: str | None = None
    unit: str | None = None
    shape: tuple[int | None, ...] = ()
    definition: Unit | None = field(default=None, compare=False)
    choices: Mapping[str, int] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Component:
    """One FMU in the system: its name there, its file, and the connectors that the SSD lists (may be none).

    Components of nested systems are named ``system.component``. ``label`` is the file as people know it.
    """

    name: str
    fmu: Path
    connectors: tuple[Connector, ...] = ()
    label: str = field(default="", compare=False)

    def connector(self, name: str) -> Connector | None:
        """The connector of this name, or None where the SSD does not list it."""
        return next((connector for connector in self.connectors if connector.name == name), None)


@dataclass(frozen=True)
class Table:
    """Pairs (source, target) of ``kind`` "Boolean", "Integer" or "Enumeration"; what no pair names is unchanged.

    The pairs are written as in SSP: truth values, whole numbers, or names of items.
    """

    kind: str
    entries: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Transformation:
    """``target = factor * convert(source) + offset``, or by a table.

    The conversion is that of the units and comes first (SSP 1.0, GTransformationChoice).
    """

    factor: float = 1.0
    offset: float = 0.0
    convert_units: bool = True
    table: Table | None = None


@dataclass(frozen=True)
class Passage:
    """A connector of a system that a connection passes through, and what is done with the values behind it."""

    connector: Connector
    transformation: Transformation = Transformation()


@dataclass(frozen=True)
class Connection:
    """``end = factor * convert(start) + offset``; an empty component name stands for the system's own connector.

    ``through`` are the connectors of nested systems on the way; factor, offset, conversion and table hold up to the
    first of them. ``start_indices`` and ``end_indices`` (from 1) restrict it to one element of an array.
    """

    start_component: str
    start_variable: str
    end_component: str
    end_variable: str
    factor: float = 1.0
    offset: float = 0.0
    convert_units: bool = True
    table: Table | None = None
    through: tuple[Passage, ...] = ()
    start_indices: tuple[int, ...] = ()
    end_indices: tuple[int, ...] = ()

    def __str__(self) -> str:
        start = f"{self.start_component}.{self.start_variable}".lstrip(".")
        return f"{start} -> {self.end_component}.{self.end_variable}".replace("-> .", "-> ")

    @property
    def at_boundary(self) -> bool:
        """Whether one end is a connector of the system itself."""
        return not self.start_component or not self.end_component

    @property
    def transformation(self) -> Transformation:
        """What is done with the values up to the first connector on the way, or up to the end."""
        return Transformation(self.factor, self.offset, self.convert_units, self.table)


@dataclass(frozen=True)
class ParameterValue:
    """A value for ``component.variable`` (or for a connector of the system) from a parameter set.

    ``unit`` is None for the variable's own unit, ``definition`` what its file says of the unit (None: it is looked up);
    ``origin`` tells people where the value was written. ``transformation`` is that of a parameter mapping, None where
    there is none; ``choices`` what the file says of the value's enumeration.
    """

    name: str
    value: Value
    unit: str | None = None
    origin: str = ""
    definition: Unit | None = None
    transformation: Transformation | None = None
    choices: Mapping[str, int] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Annotation:
    """What a tool has noted: ``owner`` is the element's name in the system ("" the system itself), ``content`` XML."""

    owner: str
    type: str
    content: str


@dataclass(frozen=True)
class System:
    """A system as its SSD describes it; components stand in the order of the SSD, times are seconds.

    Nested systems are laid flat: ``connectors`` holds those of nested systems too, as ``system.connector``. Of several
    values of one parameter the last in ``parameter_values`` holds. ``notes`` tells what was found on the way and is no
    fault. A system that was read from an .ssp lives in temporary folders: use it as a context manager, or call
    ``close`` when done.
    """

    name: str
    components: tuple[Component, ...]
    connections: tuple[Connection, ...] = ()
    parameter_values: tuple[ParameterValue, ...] = ()
    connectors: tuple[Connector, ...] = ()
    units: Mapping[str, Unit] = field(default_factory=dict)
    start_time: float = 0.0
    stop_time: float | None = None
    step_size: float | None = None
    path: Path | None = None
    annotations: tuple[Annotation, ...] = ()
    notes: tuple[str, ...] = ()
    folders: tuple[TemporaryFolder, ...] = field(default=(), repr=False, compare=False)

    def close(self) -> None:
        """Remove the temporary folders, if there are any; may be called twice."""
        for folder in self.folders:
            folder.close()

    def __enter__(self) -> System:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def nearest(name: str, names: Iterable[str]) -> str:
    """``; did you mean a, b?`` or, where nothing is near, ``; known are ...``: the end of an error message."""
    known = list(names)
    near = difflib.get_close_matches(name, known, n=3)
    if near:
        return f"; did you mean {', '.join(near)}?"
    if not known:
        return ""
    shown = ", ".join(known[:8])
    return f"; known are {shown}{', ...' if len(known) > 8 else ''}"
