"""A system against its FMUs: every connection and every value is checked before anything is computed.

What passes becomes a ``Plan``. All problems are collected; one ``SystemStructureError`` holds them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from threadpitch.cosim.c_types import family_of
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.links import Joiner
from threadpitch.cosim.order import data_order, find_loops
from threadpitch.cosim.plan import Link, Plan, Setting
from threadpitch.cosim.settings import Setter
from threadpitch.cosim.system import Connector, System, SystemStructureError, nearest
from threadpitch.cosim.values import Given
from threadpitch.cosim.variable import FmuVariable

__all__ = ["Link", "Plan", "Setting", "check"]


def check(system: System, descriptions: Mapping[str, FmuDescription], parameters: Mapping[str, Given] | None = None,
          problems: Sequence[str] = ()) -> Plan:
    """Check a system and the caller's parameters (``component.variable`` -> SI number, truth value or text).

    A parameter may name a whole array (``name`` for ``name[1]``, ``name[2]``, ...): a sequence, or a text
    with commas, sets its first elements. ``problems`` are those found before, as with components that have no
    description.

    Raises:
        SystemStructureError: with every problem found.
    """
    found = list(problems)
    notes = list(system.notes)
    joiner = Joiner(system, descriptions, found)
    notes += [f"{fmu.label or fmu.path.name}: modelDescription.xml: {oddity}; it is run nevertheless"
              for fmu in {id(fmu): fmu for fmu in descriptions.values()}.values() for oddity in fmu.oddities]
    _check_components(joiner, notes)
    links = joiner.links()
    settings = Setter(joiner, notes).settings(links, parameters or {})
    if found:
        raise SystemStructureError(*dict.fromkeys(found))
    names = [component.name for component in system.components]
    edges = [(link.source_component, link.target_component) for link in links]
    return Plan(system, descriptions, tuple(links), tuple(settings),
                data_order(names, edges), find_loops(names, edges), tuple(notes))


def _check_components(joiner: Joiner, notes: list[str]) -> None:
    """Names, what an FMU allows, and the connectors that the SSD lists."""
    joined = {end for connection in joiner.system.connections
              for end in ((connection.start_component, connection.start_variable),
                          (connection.end_component, connection.end_variable))}
    components = joiner.system.components
    names = [component.name for component in components]
    joiner.problems += [f"component name {name!r} stands twice" for name in sorted(set(names)) if names.count(name) > 1]
    for component in components:
        fmu = joiner.descriptions.get(component.name)
        if fmu is None:
            continue
        if fmu.once_per_process and [found.fmu for found in components].count(component.fmu) > 1:
            joiner.problems.append(f"component {component.name!r}: {component.fmu.name} can be instantiated only once "
                                   "per process, but several components use it; give each a copy of its own")
        listed = [connector.name for connector in component.connectors]
        joiner.problems += [f"connector {component.name}.{name} stands twice" for name in dict.fromkeys(listed)
                            if listed.count(name) > 1]
        idle: list[str] = []
        for connector in component.connectors:
            wrong = _misfit(connector, fmu)
            if wrong and (component.name, connector.name) in joined:
                if _variable(connector, fmu) is None:
                    joiner.missing(component.name, connector.name)
                    wrong += nearest(connector.name, fmu.variables)
                joiner.problems.append(f"connector {component.name}.{connector.name}: {wrong}")
            elif wrong:
                idle.append(f"connector {component.name}.{connector.name}: {wrong}")
        if idle:
            # Tools list connectors for settings of theirs that the FMU does not have; what nothing uses harms nothing.
            more = f", nor do {len(idle) - 1} more of {component.name}" if len(idle) > 1 else ""
            notes.append(f"{idle[0]}; no connection uses it{more}")


def _misfit(connector: Connector, fmu: FmuDescription) -> str:
    """Why a connector is not one of the FMU's; empty where it is."""
    elements, variable = fmu.arrays.get(connector.name, ()), _variable(connector, fmu)
    if variable is None:
        return f"{fmu.path.name} has no such variable"
    if connector.type is not None and family_of(connector.type) != variable.family:
        return f"is {connector.type}, but the FMU's variable is {variable.type}"
    if connector.kind in ("input", "output") and connector.kind != variable.causality:
        return f"is an {connector.kind}, but the FMU's variable is {variable.causality}"
    size = math.prod(extent or 0 for extent in connector.shape)
    if connector.shape and None not in connector.shape and elements and size != len(elements):
        return f"has {size} elements, but the FMU's variable has {len(elements)}"
    return ""


def _variable(connector: Connector, fmu: FmuDescription) -> FmuVariable | None:
    return fmu.variables.get(connector.name) or next(iter(fmu.arrays.get(connector.name, ())), None)
