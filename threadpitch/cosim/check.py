"""A system against its FMUs: every connection and every value is checked before anything is computed.

What passes becomes a ``Plan``. All problems are collected; one ``SystemStructureError`` holds them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from threadpitch.cosim.c_types import family_of
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.links import Joiner
from threadpitch.cosim.order import data_order, find_loops
from threadpitch.cosim.plan import Link, Plan, Setting
from threadpitch.cosim.settings import Setter
from threadpitch.cosim.system import Component, Connector, System, SystemStructureError, nearest
from threadpitch.cosim.values import Given

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
    _check_components(joiner)
    links = joiner.links()
    settings = Setter(joiner, notes).settings(links, parameters or {})
    if found:
        raise SystemStructureError(*dict.fromkeys(found))
    names = [component.name for component in system.components]
    edges = [(link.source_component, link.target_component) for link in links]
    return Plan(system, descriptions, tuple(links), tuple(settings),
                data_order(names, edges), find_loops(names, edges), tuple(notes))


def _check_components(joiner: Joiner) -> None:
    """Names, what an FMU allows, and the connectors that the SSD lists."""
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
        for connector in component.connectors:
            _check_connector(joiner, component, connector, fmu)


def _check_connector(joiner: Joiner, component: Component, connector: Connector, fmu: FmuDescription) -> None:
    where = f"connector {component.name}.{connector.name}"
    elements = fmu.arrays.get(connector.name, ())
    variable = fmu.variables.get(connector.name) or next(iter(elements), None)
    if variable is None:
        joiner.missing(component.name, connector.name)
        joiner.problems.append(f"{where}: {fmu.path.name} has no such variable{nearest(connector.name, fmu.variables)}")
    elif connector.type is not None and family_of(connector.type) != variable.family:
        joiner.problems.append(f"{where}: is {connector.type}, but the FMU's variable is {variable.type}")
    elif connector.kind in ("input", "output") and connector.kind != variable.causality:
        joiner.problems.append(f"{where}: is an {connector.kind}, but the FMU's variable is {variable.causality}")
    elif connector.shape and None not in connector.shape and elements:
        size = 1
        for extent in connector.shape:
            size *= extent or 0
        if size != len(elements):
            joiner.problems.append(f"{where}: has {size} elements, but the FMU's variable has {len(elements)}")
