"""Connections against the FMUs: what is sound becomes links between scalar variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.conversion import ConversionError, Law, Stage, between_units, joined, law, stages
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.plan import Link
from threadpitch.cosim.system import Component, Connection, System, nearest
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import UnitError

_GIVING = ("output", "calculatedParameter", "local", "constant")  # SSP 2.0, 5.4.2.1; the last three never change back


@dataclass(frozen=True)
class End:
    """One end of a connection: the component, the name that the connection states, and the scalars that it means."""

    component: Component
    name: str
    variables: tuple[FmuVariable, ...]


class Joiner:
    """Makes links; what cannot be joined is told in ``problems``. Components without a description are passed over."""

    def __init__(self, system: System, descriptions: Mapping[str, FmuDescription], problems: list[str]) -> None:
        self.system = system
        self.descriptions = descriptions
        self.components = {component.name: component for component in system.components}
        self.problems = problems
        self._told: set[tuple[str, str]] = set()  # variables that are known to be missing

    def links(self) -> list[Link]:
        """A link for every pair of variables that a connection joins; the system's own connectors carry no data."""
        links: list[Link] = []
        fed: dict[tuple[str, str], Connection] = {}
        for connection in self.system.connections:
            for link in () if connection.at_boundary else self._joined(connection):
                end = (link.target_component, link.target.name)
                if end in fed:
                    self.problems.append(f"connection {connection}: {'.'.join(end)} is fed already by {fed[end]}; "
                                         "an input takes one connection")
                else:
                    fed[end] = connection
                    links.append(link)
        return links

    def missing(self, component: str, name: str) -> None:
        """Note that a variable is missing, which a connection need not tell again."""
        self._told.add((component, name))

    def end(self, where: str, component: str, name: str, indices: tuple[int, ...] = ()) -> End | None:
        """One end of a connection; None, and a problem, where there is no such variable."""
        if component not in self.components:
            self.problems.append(f"{where}: no component {component!r}{nearest(component, self.components)}")
            return None
        fmu = self.descriptions.get(component)
        if fmu is None or (component, name) in self._told:
            return None
        variables: tuple[FmuVariable, ...] = fmu.arrays.get(name, ())
        if name in fmu.variables and not indices:
            variables = (fmu.variables[name],)
        elif indices:
            element = f"{name}[{','.join(map(str, indices))}]"
            variables = tuple(found for found in variables if found.name == element)
        if not variables:
            known = [found.name for found in fmu.arrays[name]] if name in fmu.arrays else fmu.variables
            wanted = element if indices else name
            self.problems.append(f"{where}: {component} ({fmu.path.name}) has no variable {wanted!r}"
                                 f"{nearest(wanted, known)}")
            return None
        listed = self.components[component].connectors
        if listed and self.components[component].connector(name) is None:
            self.problems.append(f"{where}: the SSD lists no connector {name!r} for component {component!r}; add it")
            return None
        return End(self.components[component], name, variables)

    def law_from(self, connection: Connection, first: Stage, end: End) -> Law:
        """What becomes of values between ``first`` and a variable.

        Raises:
            UnitError, ConversionError: as ``law``.
        """
        variable = end.variables[0]
        own = Stage(variable.unit, self.descriptions[end.component.name].unit, variable.choices)
        last = Stage.of(end.component.connector(end.name), own, self.system.units)
        passed = stages(connection, first, last, self.system.units)
        # A connector without a unit has that of the values that arrive, which at the end is the variable's.
        return joined([law(connection, passed, variable), between_units(last, own)])

    def _joined(self, connection: Connection) -> list[Link]:
        where = f"connection {connection}"
        start = self.end(where, connection.start_component, connection.start_variable, connection.start_indices)
        end = self.end(where, connection.end_component, connection.end_variable, connection.end_indices)
        if start is None or end is None:
            return []
        if not connection.through and start.variables[0].causality == "input" and (
                end.variables[0].causality in _GIVING):
            # SSP: start and end do not say which way the data go, the connectors' kinds do.
            connection, start, end = _turned(connection), end, start
        for problem in _misfits(connection, start, end):
            self.problems.append(f"{where}: {problem}")
            return []
        one = start.variables[0]
        own = Stage(one.unit, self.descriptions[start.component.name].unit, one.choices)
        first = Stage.of(start.component.connector(start.name), own, self.system.units)
        try:
            found = joined([between_units(own, first), self.law_from(connection, first, end)])
        except UnitError as error:
            if one.family == "Real":
                self.problems.append(f'{where}: {error}; mend the unit, or state suppressUnitConversion="true"')
                return []
            found = Law()
        except ConversionError as error:
            self.problems.append(f"{where}: {error}")
            return []
        strange = [target for _, target in found.table if not _holds(end.variables[0], target)]
        if strange:
            self.problems.append(f"{where}: the mapping gives {strange[0]}, which is no value of {end.name}")
        # SSP 2.0, 4.5.3.3: entries for values that the source cannot have are ignored.
        table = tuple(pair for pair in found.table if _holds(replace(one, choices=None), pair[0]))
        return [Link(start.component.name, source, end.component.name, target, found.factor, found.offset, table)
                for source, target in zip(start.variables, end.variables, strict=True)]


def _turned(connection: Connection) -> Connection:
    return replace(connection, start_component=connection.end_component, start_variable=connection.end_variable,
                   start_indices=connection.end_indices, end_component=connection.start_component,
                   end_variable=connection.start_variable, end_indices=connection.start_indices)


def _misfits(connection: Connection, start: End, end: End) -> list[str]:
    """Why variables cannot be joined."""
    one, other = start.variables[0], end.variables[0]
    if one.causality not in _GIVING or other.causality != "input":
        return [f"joins {one.causality} to {other.causality}; data go from an output to an input"]
    if len(start.variables) != len(end.variables):
        return [f"joins {len(start.variables)} values to {len(end.variables)}; arrays must have equal sizes, or state "
                "startIndices and endIndices"]
    # An Integer may feed an Enumeration, and the other way round: FMI hands over the number of the item.
    if one.kind != other.kind or not (one.exchanged and other.exchanged):
        return [f"joins {one.type} to {other.type}; both must be the same, and not String, Binary or Clock"]
    if not _fits(one, other):
        return [f"joins {one.type} to {other.type}, which does not hold all of its values"]
    return []


def _holds(variable: FmuVariable, value: int) -> bool:
    if variable.choices:
        return value in variable.choices.values()
    dtype = C_TYPES[variable.c_type].dtype
    return dtype.kind not in "iu" or np.iinfo(dtype).min <= value <= np.iinfo(dtype).max


def _fits(start: FmuVariable, end: FmuVariable) -> bool:
    """Whether every value of the one type is one of the other; a Float32 takes a Float64 rounded."""
    return start.kind != "Integer" or bool(np.can_cast(C_TYPES[start.c_type].dtype, C_TYPES[end.c_type].dtype))
