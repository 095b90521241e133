"""A system against its FMUs: every connection and every value is checked before anything is computed.

What passes becomes a ``Plan``: links between variables with one factor and offset each, and values to set. All
problems are collected; one ``SystemStructureError`` holds them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.order import data_order, find_loops
from threadpitch.cosim.system import (
    Component,
    Connection,
    Connector,
    ParameterValue,
    System,
    SystemStructureError,
    Value,
    nearest,
)
from threadpitch.cosim.values import Given, VariableValueError, from_parameter_set, from_si
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import Unit, UnitError, between


@dataclass(frozen=True)
class Link:
    """``target = factor * source + offset``, each in its FMU's own unit."""

    source_component: str
    source: FmuVariable
    target_component: str
    target: FmuVariable
    factor: float = 1.0
    offset: float = 0.0


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


def check(system: System, descriptions: Mapping[str, FmuDescription],
          parameters: Mapping[str, Given] | None = None) -> Plan:
    """Check a system and the caller's parameters (``component.variable`` -> SI number, truth value or text).

    A parameter may name a whole array (``name`` for ``name[1]``, ``name[2]``, ...): a sequence, or a text
    with commas, sets its first elements.

    Raises:
        SystemStructureError: with every problem found.
    """
    checker = _Checker(system, descriptions)
    links = checker.links()
    settings = checker.settings(links, parameters or {})
    if checker.problems:
        raise SystemStructureError(*checker.problems)
    names = [component.name for component in system.components]
    edges = [(link.source_component, link.target_component) for link in links]
    return Plan(system, descriptions, tuple(links), tuple(settings),
                data_order(names, edges), find_loops(names, edges), tuple(checker.notes))


class _Checker:
    """Collects problems on the way, so that a user mends them all at once."""

    def __init__(self, system: System, descriptions: Mapping[str, FmuDescription]) -> None:
        self.system = system
        self.descriptions = descriptions
        self.components = {component.name: component for component in system.components}
        self.problems: list[str] = []
        self.notes: list[str] = []
        names = [component.name for component in system.components]
        self.problems += [f"component name {name!r} stands twice" for name in sorted(set(names))
                          if names.count(name) > 1]
        for component in system.components:
            self._check_component(component)

    def _check_component(self, component: Component) -> None:
        fmu = self.descriptions[component.name]
        if fmu.once_per_process and [found.fmu for found in self.system.components].count(component.fmu) > 1:
            self.problems.append(f"component {component.name!r}: {component.fmu.name} can be instantiated only once "
                                 "per process, but several components use it; give each a copy of its own")
        for connector in component.connectors:
            variable = fmu.variables.get(connector.name)
            where = f"connector {component.name}.{connector.name}"
            if variable is None:
                self.problems.append(f"{where}: {fmu.path.name} has no such variable"
                                     f"{nearest(connector.name, fmu.variables)}")
            elif connector.type not in (None, variable.type, variable.family):
                self.problems.append(f"{where}: is {connector.type}, but the FMU's variable is {variable.type}")
            elif connector.kind in ("input", "output") and connector.kind != variable.causality:
                self.problems.append(f"{where}: is an {connector.kind}, but the FMU's variable is {variable.causality}")

    # Connections

    def links(self) -> list[Link]:
        """A link for every connection between components; those to the system's own connectors carry no data."""
        links: list[Link] = []
        fed: dict[tuple[str, str], Connection] = {}
        for connection in self.system.connections:
            link = None if connection.at_boundary else self._link(connection)
            if link is None:
                continue
            end = (link.target_component, link.target.name)
            if end in fed:
                self.problems.append(f"connection {connection}: {'.'.join(end)} is fed already by {fed[end]}; "
                                     "an input takes one connection")
            else:
                fed[end] = connection
                links.append(link)
        return links

    def _link(self, connection: Connection) -> Link | None:
        where = f"connection {connection}"
        start = self._variable(where, connection.start_component, connection.start_variable)
        end = self._variable(where, connection.end_component, connection.end_variable)
        if start is None or end is None:
            return None
        if (start.causality, end.causality) == ("input", "output"):
            # SSP 1.0: start and end do not say which way the data go, the connectors' kinds do.
            turned = replace(connection, start_component=connection.end_component, start_variable=end.name,
                             end_component=connection.start_component, end_variable=start.name)
            connection, start, end = turned, end, start
        if start.causality != "output" or end.causality != "input":
            self.problems.append(f"{where}: joins {start.causality} to {end.causality}; data go from an output to an "
                                 "input")
            return None
        if start.family != end.family or not (start.exchanged and end.exchanged):
            self.problems.append(f"{where}: joins {start.type} to {end.type}; both must be the same, and not String, "
                                 "Binary or Clock")
            return None
        if not _fits(start, end):
            self.problems.append(f"{where}: joins {start.type} to {end.type}, which does not hold all of its values")
            return None
        if start.family != "Real":
            if (connection.factor, connection.offset) != (1.0, 0.0):
                self.problems.append(f"{where}: a linear transformation serves Real variables, not {start.type}")
            return Link(connection.start_component, start, connection.end_component, end)
        try:
            factor, offset = self._conversion(connection, start, end)
        except UnitError as error:
            self.problems.append(f'{where}: {error}; mend the unit, or state suppressUnitConversion="true"')
            return None
        return Link(connection.start_component, start, connection.end_component, end, factor, offset)

    def _variable(self, where: str, component: str, name: str) -> FmuVariable | None:
        if component not in self.components:
            self.problems.append(f"{where}: no component {component!r}{nearest(component, self.components)}")
            return None
        fmu = self.descriptions[component]
        if name not in fmu.variables:
            self.problems.append(f"{where}: {component} ({fmu.path.name}) has no variable {name!r}"
                                 f"{nearest(name, fmu.variables)}")
            return None
        listed = self.components[component].connectors
        if listed and self.components[component].connector(name) is None:
            self.problems.append(f"{where}: the SSD lists no connector {name!r} for component {component!r}; add it")
            return None
        return fmu.variables[name]

    def _conversion(self, connection: Connection, start: FmuVariable, end: FmuVariable) -> tuple[float, float]:
        """(factor, offset) from the start's FMU unit through both connectors' units to the end's FMU unit.

        The unit conversion comes first, then the linear transformation (SSP 1.0, GTransformationChoice).
        """
        giver, taker = connection.start_component, connection.end_component
        start_unit = _connector_unit(self.components[giver].connector(start.name), start)
        end_unit = _connector_unit(self.components[taker].connector(end.name), end)
        of_start, of_end = self.descriptions[giver].unit, self.descriptions[taker].unit
        factor, offset = _convert((start.unit, of_start), (start_unit, self._unit_of(of_start)))
        if connection.convert_units:
            ends = (start_unit, self._unit_of(of_start)), (end_unit, self._unit_of(of_end))
            factor, offset = _after((factor, offset), _convert(*ends))
        factor, offset = _after((factor, offset), (connection.factor, connection.offset))
        return _after((factor, offset), _convert((end_unit, self._unit_of(of_end)), (end.unit, of_end)))

    def _unit_of(self, known: Callable[[str], Unit]) -> Callable[[str], Unit]:
        """A look-up for units that an SSD names: its own definitions first, then those of the FMU and the table."""
        return lambda name: self.system.units[name] if name in self.system.units else known(name)

    # Values

    def settings(self, links: Sequence[Link], parameters: Mapping[str, Given]) -> list[Setting]:
        """The last value given for every variable: parameter sets in their order, then the caller's parameters."""
        fed = {(link.target_component, link.target.name): link for link in links}
        found: dict[tuple[str, str], Setting] = {}
        for value in self.system.parameter_values:
            for target, variable in self._targets(value):
                known = self._unit_of(self.descriptions[target].unit)
                try:
                    setting = Setting(target, variable, from_parameter_set(value, variable, known))
                except VariableValueError as error:
                    self.problems.append(f"{value.origin}: {value.name}: {error}".lstrip(": "))
                else:
                    found[target, variable.name] = setting
        for name, given in parameters.items():
            for setting in self._given(name, given):
                found[setting.component, setting.variable.name] = setting
        for end, setting in found.items():
            name = ".".join(end)
            if end in fed:
                giver = fed[end]
                self.problems.append(f"{name} cannot be set: {giver.source_component}.{giver.source.name} feeds it")
            elif not setting.variable.settable:
                self.problems.append(f"{name} cannot be set: it is {setting.variable.causality}; parameters and inputs "
                                     "can")
        return [replace(setting, starts=self._starts(setting)) for setting in found.values()]

    def _starts(self, setting: Setting) -> tuple[float, ...]:
        """What the elements of an array are where nobody sets them: an array is set as a whole."""
        variable = setting.variable
        if variable.size == 1:
            return ()
        elements = self.descriptions[setting.component].arrays[variable.name.rpartition("[")[0]]
        return tuple(0.0 if element.start is None else element.start for element in elements)

    def _targets(self, value: ParameterValue) -> Iterator[tuple[str, FmuVariable]]:
        """The variables that an entry of a parameter set means; SSP says to ignore what names nothing."""
        component, _, variable = value.name.partition(".")
        if component in self.components and variable in self.descriptions[component].variables:
            yield component, self.descriptions[component].variables[variable]
        elif any(connector.name == value.name for connector in self.system.connectors):
            for connection in self.system.connections:
                if not connection.start_component and connection.start_variable == value.name:
                    target = self._variable(f"connection {connection}", connection.end_component,
                                            connection.end_variable)
                    if target is not None:
                        yield connection.end_component, target
        else:
            self.notes.append(f"{value.origin}: {value.name} names nothing in the system and is ignored")

    def _given(self, name: str, given: Given) -> list[Setting]:
        component, _, rest = name.partition(".")
        if component not in self.components or not rest:
            hint = nearest(component, self.components) if rest else "; write it as component.variable"
            self.problems.append(f"parameter {name!r}: no component {component!r}{hint}")
            return []
        fmu = self.descriptions[component]
        if rest in fmu.variables:
            pairs: list[tuple[FmuVariable, object]] = [(fmu.variables[rest], given)]
        elif rest in fmu.arrays:
            pairs = self._elements(name, fmu.arrays[rest], given)
        else:
            names = [variable.name for variable in fmu.variables.values() if variable.settable]
            self.problems.append(f"parameter {name!r}: {component} has no variable {rest!r}{nearest(rest, names)}")
            return []
        settings = []
        for element, value in pairs:
            try:
                settings.append(Setting(component, element, from_si(value, element, fmu.unit)))
            except VariableValueError as error:
                self.problems.append(f"parameter {component}.{element.name}: {error}")
        return settings

    def _elements(self, name: str, elements: Sequence[FmuVariable], given: Given) -> list[tuple[FmuVariable, object]]:
        single = [given] if isinstance(given, int | float) else given
        values: Sequence[object] = single.split(",") if isinstance(single, str) else single
        if not 1 <= len(values) <= len(elements):
            self.problems.append(f"parameter {name!r}: {len(values)} values for an array of {len(elements)}")
            return []
        return list(zip(elements, values, strict=False))


def _fits(start: FmuVariable, end: FmuVariable) -> bool:
    """Whether every value of the one type is one of the other; a Float32 takes a Float64 rounded."""
    return start.family != "Integer" or bool(np.can_cast(C_TYPES[start.c_type].dtype, C_TYPES[end.c_type].dtype))


def _connector_unit(connector: Connector | None, variable: FmuVariable) -> str | None:
    return variable.unit if connector is None or connector.unit is None else connector.unit


_Named = tuple[str | None, Callable[[str], Unit]]  # a unit's name and where to look it up


def _convert(one: _Named, other: _Named) -> tuple[float, float]:
    """(factor, offset) between two units; equal names and missing units convert to themselves."""
    if one[0] == other[0] or not one[0] or not other[0]:
        return 1.0, 0.0
    return between(one[1](one[0]), other[1](other[0]))


def _after(first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float]:
    """(factor, offset) of the second transformation applied to the result of the first."""
    return second[0] * first[0], second[0] * first[1] + second[1]
