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

from threadpitch.cosim.archive import TemporaryFolder
from threadpitch.cosim.errors import CosimError
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
    "Enumeration" or None, ``unit`` the unit of the values that pass through it, None for that of the FMU's variable.
    """

    name: str
    kind: str
    type: str | None = None
    unit: str | None = None


@dataclass(frozen=True)
class Component:
    """One FMU in the system: its name there, its file, and the connectors that the SSD lists (may be none)."""

    name: str
    fmu: Path
    connectors: tuple[Connector, ...] = ()

    def connector(self, name: str) -> Connector | None:
        """The connector of this name, or None where the SSD does not list it."""
        return next((connector for connector in self.connectors if connector.name == name), None)


@dataclass(frozen=True)
class Connection:
    """``end = factor * convert(start) + offset``; an empty component name stands for the system's own connector.

    The conversion is that of the units and comes first (SSP 1.0, GTransformationChoice).
    """

    start_component: str
    start_variable: str
    end_component: str
    end_variable: str
    factor: float = 1.0
    offset: float = 0.0
    convert_units: bool = True

    def __str__(self) -> str:
        start = f"{self.start_component}.{self.start_variable}".lstrip(".")
        return f"{start} -> {self.end_component}.{self.end_variable}".replace("-> .", "-> ")

    @property
    def at_boundary(self) -> bool:
        """Whether one end is a connector of the system itself."""
        return not self.start_component or not self.end_component


@dataclass(frozen=True)
class ParameterValue:
    """A value for ``component.variable`` (or for a connector of the system) from a parameter set.

    ``unit`` is None for the variable's own unit, ``definition`` what its file says of the unit (None: it is looked up);
    ``origin`` tells people where the value was written.
    """

    name: str
    value: Value
    unit: str | None = None
    origin: str = ""
    definition: Unit | None = None


@dataclass(frozen=True)
class System:
    """A system as its SSD describes it; components stand in the order of the SSD, times are seconds.

    Of several values of one parameter the last in ``parameter_values`` holds. A system that was read from an .ssp
    lives in a temporary folder: use it as a context manager, or call ``close`` when done.
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
    folder: TemporaryFolder | None = field(default=None, repr=False, compare=False)

    def close(self) -> None:
        """Remove the temporary folder, if there is one; may be called twice."""
        if self.folder is not None:
            self.folder.close()

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
