"""A whole system as its SSD states it, made of plain model objects instead of FMUs, and stepped in two orders.

The plan (order, links, values) comes from reading the SSD, so that nothing of the wiring is written twice.
"""

from __future__ import annotations

import functools
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpitch import cosim, lathe
from threadpitch.cosim.check import Link, Plan
from threadpitch.cosim.values import Given
from threadpitch.fmu import read_model

KINDS = ("Real", "Integer", "Boolean")
_CODES = {"Real": "d", "Integer": "i", "Boolean": "i"}  # of struct: as FMI 2.0 carries them


def read_plan(system: str | Path = lathe.DEFAULT_SYSTEM, parameters: Mapping[str, Given] | None = None) -> Plan:
    """The checked plan of a system; its unpacked files are gone again, which a plan does not need."""
    locate = functools.partial(lathe.locate_fmu, lathe.choose_flavor())
    with cosim.read_system(lathe.find_system(system), locate=locate) as structure, \
            cosim.prepare(structure, parameters) as plan:
        return plan


@dataclass(frozen=True)
class Layout:
    """Everything that one component calculates: names by the type of the FMI functions that get them."""

    component: str
    names: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, plan: Plan, component: str) -> Layout:
        variables = plan.descriptions[component].variables.values()
        return cls(component, {kind: tuple(one.name for one in variables
                                           if one.causality in ("output", "local") and one.kind == kind)
                               for kind in KINDS})

    @property
    def struct(self) -> str:
        """Format of one row of this component."""
        return "<" + "".join(f"{len(names)}{_CODES[kind]}" for kind, names in self.names.items())

    @property
    def flat(self) -> tuple[str, ...]:
        """``component.variable`` in the order of a row."""
        return tuple(f"{self.component}.{name}" for names in self.names.values() for name in names)


class PlainComponent:
    """One model object whose variables are read and written by their FMI names."""

    def __init__(self, model: Any, layout: Layout) -> None:
        self.model = model
        self._struct = struct.Struct(layout.struct)
        self._places = [_place(name) for names in layout.names.values() for name in names]

    def put(self, name: str, value: object) -> None:
        attribute, index = _place(name)
        if index is None:
            setattr(self.model, attribute, value)
        else:
            getattr(self.model, attribute)[index] = value

    def get(self, name: str) -> Any:
        attribute, index = _place(name)
        value = getattr(self.model, attribute)
        return value if index is None else value[index]

    def row(self) -> bytes:
        """Everything that it calculates, as bits."""
        fields = vars(self.model)
        return self._struct.pack(*(fields[attribute] if index is None else fields[attribute][index]
                                   for attribute, index in self._places))


@functools.cache
def _place(name: str) -> tuple[str, int | None]:
    """``pitch[2]`` -> ("pitch", 1)."""
    found = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", name)
    assert found is not None, name
    return found[1], int(found[2]) - 1 if found[2] else None


class PlainSystem:
    """The objects of a plan with its values, each initialised by itself; ``settle`` makes them consistent."""

    def __init__(self, plan: Plan) -> None:
        self.layouts = [Layout.of(plan, name) for name in plan.order]
        self.components = {layout.component: PlainComponent(_model(plan, layout.component), layout)
                           for layout in self.layouts}
        self._links = plan.links
        self._incoming = {name: [link for link in plan.links if link.target_component == name] for name in plan.order}
        for setting in plan.settings:
            self.components[setting.component].put(setting.variable.name, setting.value)
        for component in self.components.values():
            assert component.model.check() == 0
            component.model.initialize()

    def settle(self) -> None:
        """Hand the start values round until they rest."""
        for _ in range(len(self.components) + 1):
            for name, component in self.components.items():
                self._receive(self._incoming[name])
                component.model.initialize()

    def gauss_seidel_step(self, time: float, step_size: float) -> None:
        """Each component sees what those before it have calculated for the end of the step."""
        for name, component in self.components.items():
            self._receive(self._incoming[name])
            assert component.model.step(time, step_size) == 0

    def jacobi_step(self, time: float, step_size: float) -> None:
        """All step with the inputs that they have; then all links at once."""
        for component in self.components.values():
            assert component.model.step(time, step_size) == 0
        self.transfer()

    def transfer(self) -> None:
        """All links at once: no output depends on an input but through a step."""
        self._receive(self._links)

    def row(self) -> bytes:
        """Everything that all components calculate, as bits."""
        return b"".join(component.row() for component in self.components.values())

    def _receive(self, links: tuple[Link, ...] | list[Link]) -> None:
        for link in links:
            assert (link.factor, link.offset) == (1.0, 0.0)
            value = self.components[link.source_component].get(link.source.name)
            self.components[link.target_component].put(link.target.name, value)


def _model(plan: Plan, component: str) -> Any:
    """An object of the dataclass itself, from the model's file."""
    return read_model(lathe.model_file(plan.descriptions[component].path.stem)).model_class()
