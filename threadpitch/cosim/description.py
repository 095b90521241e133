"""What an FMU says of itself: its variables, units and abilities, as plain typed values."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fmpy import platform, read_model_description, supported_platforms

from threadpitch.cosim.archive import TemporaryFolder, unpack
from threadpitch.cosim.document import DocumentError, Element, parse_document
from threadpitch.cosim.errors import CosimError
from threadpitch.units import BASES, Unit, UnitError, unit


class FmuError(CosimError):
    """A file is not an FMU that can be run here."""


@dataclass(frozen=True)
class FmuVariable:
    """One scalar variable. ``type`` is the FMI 2.0 word, ``kind`` the FMI functions that carry it.

    ``kind`` is "Real", "Integer" (Enumerations too), "Boolean" or "String". ``choices`` names an Enumeration's values,
    or those of an Integer that our own annotation names.
    ``settable`` tells whether it takes a value before initialisation.
    """

    name: str
    reference: int
    type: str
    causality: str
    unit: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: Mapping[str, int] | None = None
    settable: bool = False

    @property
    def kind(self) -> str:
        """The type of the FMI functions that get and set it."""
        return "Integer" if self.type == "Enumeration" else self.type


@dataclass(frozen=True)
class FmuDescription:
    """An unpacked FMU; ``units`` are those that it defines itself, display units included."""

    path: Path
    folder: Path
    guid: str
    model_identifier: str
    variables: Mapping[str, FmuVariable]
    units: Mapping[str, Unit]
    log_categories: tuple[str, ...] = ()
    step_size: float | None = None  # s, of its default experiment
    once_per_process: bool = False
    temporary: TemporaryFolder | None = None

    def unit(self, name: str) -> Unit:
        """The unit as the FMU defines it or, where it does not, as the table of units does.

        Raises:
            UnitError: neither knows it.
        """
        return self.units[name] if name in self.units else unit(name)

    @cached_property
    def arrays(self) -> Mapping[str, tuple[FmuVariable, ...]]:
        """Arrays of FMI 2.0: ``name`` -> its elements ``name[1]``, ``name[2]``, ... in their order."""
        arrays: dict[str, list[FmuVariable]] = {}
        for variable in self.variables.values():
            name, bracket, index = variable.name.rpartition("[")
            if bracket and index == f"{len(arrays.get(name, ())) + 1}]":
                arrays.setdefault(name, []).append(variable)
        return {name: tuple(elements) for name, elements in arrays.items()}

    def close(self) -> None:
        """Remove the unpacked files; may be called twice."""
        if self.temporary is not None:
            self.temporary.close()


def read_fmu(path: Path) -> FmuDescription:
    """Unpack an FMU into a temporary folder and read its description.

    Raises:
        ArchiveError: the file is missing or not a sound archive.
        FmuError: the description is missing or wrong, the FMU is not FMI 2.0 for co-simulation, or it holds no binary
            for this platform.
    """
    temporary = unpack(path)
    folder = temporary.path
    description, choices = _model_description(path, folder)
    if not str(description.fmiVersion).startswith("2."):
        raise FmuError(f"{path}: is FMI {description.fmiVersion}; only FMI 2.0 co-simulation can be run")
    if description.coSimulation is None:
        raise FmuError(f"{path}: offers model exchange only; export it for co-simulation")
    platforms = supported_platforms(folder)
    if platform not in platforms:
        raise FmuError(f"{path}: holds no binary for {platform}, only {', '.join(platforms) or 'none'}")
    experiment = description.defaultExperiment
    return FmuDescription(
        path=path,
        folder=folder,
        guid=description.guid,
        model_identifier=description.coSimulation.modelIdentifier,
        variables={found.name: _variable(found, choices.get(found.name)) for found in description.modelVariables},
        units=_units(description),
        log_categories=tuple(category.name for category in description.logCategories),
        step_size=_float(experiment.stepSize) if experiment is not None else None,
        once_per_process=description.coSimulation.canBeInstantiatedOnlyOncePerProcess,
        temporary=temporary,
    )


def _model_description(path: Path, folder: Path) -> tuple[Any, dict[str, dict[str, int]]]:
    """What FMPy reads, and the named values of Integers, which it leaves out."""
    file = folder / "modelDescription.xml"
    if not file.is_file():
        raise FmuError(f"{path}: holds no modelDescription.xml; it is not an FMU")
    try:
        root = parse_document(file)  # FMPy's parser resolves entities: what declares any is refused before it sees it
        return read_model_description(folder), _choices(root)
    except DocumentError as error:
        raise FmuError(f"{path}: modelDescription.xml: {error}") from None
    except Exception as error:  # FMPy raises plain Exception for what its schema or rules refuse
        first = str(getattr(error, "problems", [error])[0]).splitlines()[0]
        raise FmuError(f"{path}: modelDescription.xml is not valid: {first}") from None


def _choices(root: Element) -> dict[str, dict[str, int]]:
    """By variable: the names and numbers of ``Annotations/Tool[@name="threadpitch"]/Choices/Choice``."""
    choices: dict[str, dict[str, int]] = {}
    for choice in root.iterfind("ModelVariables/ScalarVariable/Annotations/Tool[@name='threadpitch']/Choices/Choice"):
        variable = next(choice.iterancestors("ScalarVariable")).get("name", "")
        with contextlib.suppress(ValueError):  # somebody else's annotation: without meaning for us
            choices.setdefault(variable, {})[choice.get("name", "")] = int(choice.get("value", ""))
    return choices


def _variable(found: Any, choices: Mapping[str, int] | None = None) -> FmuVariable:
    declared = found.declaredType
    if found.type == "Enumeration" and declared is not None:
        choices = {item.name: int(item.value) for item in declared.items}
    return FmuVariable(
        name=found.name,
        reference=found.valueReference,
        type=found.type,
        causality=found.causality,
        unit=found.unit or getattr(declared, "unit", None),
        minimum=_float(found.min if found.min is not None else getattr(declared, "min", None)),
        maximum=_float(found.max if found.max is not None else getattr(declared, "max", None)),
        choices=choices,
        settable=found.variability != "constant" and (
            found.causality == "input" or found.initial in ("exact", "approx")),
    )


def _units(description: Any) -> dict[str, Unit]:
    units: dict[str, Unit] = {}
    for defined in description.unitDefinitions:
        base = defined.baseUnit
        if base is None:
            try:
                units[defined.name] = unit(defined.name)
            except UnitError:
                continue
        else:
            exponents = tuple(getattr(base, name) for name in BASES)
            units[defined.name] = Unit(defined.name, exponents, base.factor, base.offset)
        one = units[defined.name]
        for display in defined.displayUnits:
            # FMI 2.0, 2.2.2: display value = factor * value + offset, the other way round than the base unit's.
            if display.factor:
                units.setdefault(display.name, Unit(
                    display.name, one.exponents, one.factor / display.factor,
                    one.offset - one.factor * display.offset / display.factor))
    return units


def _float(text: str | None) -> float | None:
    if text is None:
        return None
    value = float(text)
    return None if math.isnan(value) else value
