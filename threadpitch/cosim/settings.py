"""Values against the FMUs: what parameter sets and the caller state becomes settings of scalar variables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from threadpitch.cosim.conversion import ConversionError, Known, Stage, looked_up
from threadpitch.cosim.links import Joiner
from threadpitch.cosim.plan import Link, Setting
from threadpitch.cosim.system import Connector, ParameterValue, Table, Value, nearest
from threadpitch.cosim.values import Given, VariableValueError, from_parameter_set, from_si
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import UnitError, unit


class Setter:
    """Makes settings; problems and notes go to the lists that the joiner of the connections and the caller hold."""

    def __init__(self, joiner: Joiner, notes: list[str]) -> None:
        self.joiner = joiner
        self.system = joiner.system
        self.descriptions = joiner.descriptions
        self.problems = joiner.problems
        self.notes = notes

    def settings(self, links: Sequence[Link], parameters: Mapping[str, Given]) -> list[Setting]:
        """The last value given for every variable: parameter sets in their order, then what the connectors of systems
        hand on, which arrives after a variable's own value, then the caller's parameters.
        """
        fed = {(link.target_component, link.target.name): link for link in links}
        found: dict[tuple[str, str], Setting] = {}
        for settings_of in (self._of, self._handed_on):
            for value in self.system.parameter_values:
                try:
                    for setting in settings_of(value):
                        found[setting.component, setting.variable.name] = setting
                except (VariableValueError, ConversionError, UnitError) as error:
                    self.problems.append(f"{value.origin}: {value.name}: {error}".lstrip(": "))
        return self.overridden(found, fed, parameters)

    def overridden(self, settings: Mapping[tuple[str, str], Setting], fed: Mapping[tuple[str, str], Link],
                   parameters: Mapping[str, Given]) -> list[Setting]:
        """Settings by component and variable, the caller's parameters in the place of some; ``fed`` are the links by
        what they feed, which nobody may set.
        """
        found = dict(settings)
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

    # Parameter sets

    def _of(self, value: ParameterValue) -> Iterator[Setting]:
        """What an entry of a parameter set sets: all that has its name. SSP says to ignore what names nothing."""
        places = list(self._places(value.name))
        if not places and self._connector(value.name) is None:
            self.notes.append(f"{value.origin}: {value.name} names nothing in the system and is ignored")
        for component, variables in places:
            if len(variables) != 1:
                raise VariableValueError(f"one value for an array of {len(variables)}; state all, or one element")
            known = self._known(self.descriptions[component].unit)
            yield Setting(component, variables[0], from_parameter_set(_mapped(value), variables[0], known))

    def _handed_on(self, value: ParameterValue) -> Iterator[Setting]:
        """What an entry of a parameter set for a connector of a system sets behind it."""
        def read(there: FmuVariable, known: Known) -> Value:
            return from_parameter_set(_mapped(value), there, known)

        return self._through(value.name, read)

    def _connector(self, name: str) -> Connector | None:
        """The connector of a system."""
        return next((found for found in self.system.connectors if found.name == name), None)

    def _places(self, name: str) -> Iterator[tuple[str, Sequence[FmuVariable]]]:
        """The components' variables, or arrays, that a name means: dots may part systems, components and structures."""
        for number in range(len(name)):
            component, rest = name[:number], name[number + 1:]
            if name[number] == "." and component in self.joiner.components:
                fmu = self.descriptions.get(component)
                if fmu is None:
                    yield from ()
                elif rest in fmu.variables:
                    yield component, [fmu.variables[rest]]
                elif rest in fmu.arrays:
                    yield component, fmu.arrays[rest]

    def _through(self, name: str, read: Callable[[FmuVariable, Known], Value]) -> Iterator[Setting]:
        """The settings of what a system's connector feeds: the value in the connector's unit, then as the data go."""
        connector = self._connector(name)
        for connection in self.system.connections:
            if connector is None or connection.start_component or connection.start_variable != name:
                continue
            where = f"connection {connection}"
            end = connection.end_component and self.joiner.end(
                where, connection.end_component, connection.end_variable, connection.end_indices)
            if not end:
                continue
            variable = end.variables[0]
            if len(end.variables) != 1:
                raise VariableValueError(f"one value for an array of {len(end.variables)}; state all, or one element")
            own = Stage(variable.unit, self.descriptions[end.component.name].unit, variable.choices)
            named = [connector.unit, *(passage.connector.unit for passage in connection.through), variable.unit]
            first = Stage.of(connector, replace(own, unit=next(filter(None, named), None)), self.system.units)
            there = replace(variable, unit=first.unit, minimum=None, maximum=None, choices=first.choices)
            given = read(there, first.known)
            law = self.joiner.law_from(connection, first, end)
            if variable.family == "Real":
                given = law.factor * float(given) + law.offset
            elif variable.family != "String":
                given = dict(law.table).get(int(given), given)
            yield Setting(end.component.name, variable, from_si(given, replace(variable, unit=None), unit))

    def _known(self, otherwise: Known) -> Known:
        """A look-up for units that an SSD names: its own definitions first, then those of the FMU and the table."""
        return lambda name: self.system.units[name] if name in self.system.units else otherwise(name)

    # The caller's parameters

    def _given(self, name: str, given: Given) -> list[Setting]:
        if self._connector(name) is not None:
            return self._given_to_connector(name, given)
        component, rest = self._parted(name)
        if component not in self.joiner.components or not rest:
            hint = nearest(component, self.joiner.components) if rest else "; write it as component.variable"
            self.problems.append(f"parameter {name!r}: no component {component!r}{hint}")
            return []
        fmu = self.descriptions.get(component)
        if fmu is None:
            return []
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

    def _given_to_connector(self, name: str, given: Given) -> list[Setting]:
        def read(there: FmuVariable, known: Known) -> Value:
            return from_si(given, there, known)

        try:
            found = list(self._through(name, read))
        except (VariableValueError, ConversionError, UnitError) as error:
            self.problems.append(f"parameter {name}: {error}")
            return []
        if not found:
            self.problems.append(f"parameter {name!r}: it is a connector of the system that feeds nothing; set "
                                 "component.variable instead")
        return found

    def _parted(self, name: str) -> tuple[str, str]:
        """Component and variable: the longest component's name that it begins with, else up to the first dot."""
        for component in sorted(self.joiner.components, key=len, reverse=True):
            if name.startswith(f"{component}."):
                return component, name[len(component) + 1:]
        component, _, rest = name.partition(".")
        return component, rest

    def _elements(self, name: str, elements: Sequence[FmuVariable], given: Given) -> list[tuple[FmuVariable, object]]:
        single = [given] if isinstance(given, int | float) else given
        values: Sequence[object] = single.split(",") if isinstance(single, str) else single
        if not 1 <= len(values) <= len(elements):
            self.problems.append(f"parameter {name!r}: {len(values)} values for an array of {len(elements)}")
            return []
        return list(zip(elements, values, strict=False))


def _mapped(value: ParameterValue) -> ParameterValue:
    """The value as the table of its parameter mapping, if it has one, gives it."""
    table: Table | None = None if value.transformation is None else value.transformation.table
    if table is None:
        return value
    given = value.value
    if isinstance(given, float) or (table.kind == "Boolean") != isinstance(given, bool):
        raise ConversionError(f"a mapping of {table.kind} values serves no {type(given).__name__} values")
    found: Value = looked_up(table, given, value.choices)
    return replace(value, value=found)
