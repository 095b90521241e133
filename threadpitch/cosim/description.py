"""What an FMU says of itself: its variables, units and abilities, as plain typed values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from fmpy import platform, platform_tuple, read_model_description, supported_platforms
from fmpy.model_description import ValidationError

from threadpitch.cosim.archive import MAXIMUM_SIZE, unpack
from threadpitch.cosim.document import DocumentError, Element, parse_document
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.temporary_folder import TemporaryFolder
from threadpitch.cosim.variable import FmuVariable
from threadpitch.cosim.variables import read_variables, to_number
from threadpitch.units import BASES, Unit, UnitError, unit

# What FMPy's validation finds and no run depends on: units are looked up in the table too, and what is no Real is never
# taken for continuous. Exports of Saab's, Hopsan's and Dymola's tools that are in use break these two rules.
_HARMLESS = re.compile(r'The (display )?unit ".*" of .* is not defined|must have variability != "continuous"')
_IDENTIFIER = re.compile(r"[^./\\:\0][^/\\:\0]*")  # it becomes the name of a file that is loaded


class FmuError(CosimError):
    """A file is not an FMU that can be run here."""


@dataclass(frozen=True)
class FmuDescription:
    """An unpacked FMU of FMI version ``fmi``; ``units`` are those that it defines itself, display units included.

    ``guid`` is FMI 3.0's instantiationToken too. ``label`` is the file as people know it, ``capabilities`` the flags
    that its co-simulation interface sets. ``dependencies`` holds by output the inputs that it depends on directly;
    an output that is not in it may depend on all. ``oddities`` is what breaks a rule of FMI without harm to a run.
    """

    path: Path
    folder: Path
    guid: str
    model_identifier: str
    variables: Mapping[str, FmuVariable]
    units: Mapping[str, Unit]
    log_categories: tuple[str, ...] = ()
    step_size: float | None = None  # s, of its default experiment
    once_per_process: bool = False
    serializes_state: bool = False
    fmi: int = 2
    label: str = ""
    version: str = ""  # of FMI, as it is written
    tool: str = ""
    platforms: tuple[str, ...] = ()
    capabilities: tuple[str, ...] = ()
    dependencies: Mapping[str, frozenset[str]] = field(default_factory=dict)
    oddities: tuple[str, ...] = ()
    temporary: TemporaryFolder | None = None

    def unit(self, name: str) -> Unit:
        """The unit as the FMU defines it or, where it does not, as the table of units does.

        Raises:
            UnitError: neither knows it.
        """
        return self.units[name] if name in self.units else unit(name)

    @cached_property
    def arrays(self) -> Mapping[str, tuple[FmuVariable, ...]]:
        """Arrays: ``name`` -> its elements ``name[1]``, ``name[2]``, ... in their order."""
        arrays: dict[str, list[FmuVariable]] = {}
        for variable in self.variables.values():
            name, bracket, index = variable.name.rpartition("[")
            found = arrays.setdefault(name, []) if bracket else []
            if variable.size > 1 or index == f"{len(found) + 1}]":
                found.append(variable)
        return {name: tuple(elements) for name, elements in arrays.items() if elements}

    def close(self) -> None:
        """Remove the unpacked files; may be called twice."""
        if self.temporary is not None:
            self.temporary.close()


def read_fmu(path: Path, label: str = "", room: int = MAXIMUM_SIZE) -> FmuDescription:
    """Unpack an FMU into a temporary folder, of at most ``room`` bytes, and read its description.

    Raises:
        ArchiveError: the file is missing or not a sound archive.
        FmuError: the description is missing or wrong, the FMU is not FMI 2.0 or 3.0 for co-simulation, or it holds
            no binary for this platform.
    """
    label = label or str(path)
    temporary = unpack(path, label, room)
    try:
        return _read(path, label, temporary)
    except CosimError:
        temporary.close()
        raise


def _read(path: Path, label: str, temporary: TemporaryFolder) -> FmuDescription:
    folder = temporary.path
    description, root, oddities = _model_description(label, folder)
    fmi = {"2": 2, "3": 3}.get(str(description.fmiVersion).partition(".")[0])
    if fmi is None:
        raise FmuError(f"{label}: is FMI {description.fmiVersion}; only FMI 2.0 and 3.0 co-simulation can be run")
    slave = description.coSimulation
    if slave is None:
        raise FmuError(f"{label}: offers model exchange only; export it for co-simulation")
    if not _IDENTIFIER.fullmatch(slave.modelIdentifier):
        raise FmuError(f"{label}: modelIdentifier {slave.modelIdentifier!r} is not the name of a library; refused")
    platforms = _platforms(label, folder, fmi)
    experiment = description.defaultExperiment
    try:
        variables = {found.name: found for found in read_variables(description, root)}
    except CosimError as error:
        raise FmuError(f"{label}: {error}") from None
    return FmuDescription(
        path=path,
        folder=folder,
        guid=description.guid,
        model_identifier=slave.modelIdentifier,
        variables=variables,
        units=_units(description),
        log_categories=tuple(category.name for category in description.logCategories),
        step_size=to_number(experiment.stepSize) if experiment is not None else None,
        once_per_process=slave.canBeInstantiatedOnlyOncePerProcess,
        serializes_state=slave.canGetAndSetFMUstate and slave.canSerializeFMUstate,
        fmi=fmi,
        label=label,
        version=str(description.fmiVersion),
        tool=description.generationTool or "",
        platforms=platforms,
        capabilities=tuple(sorted(_flags(root))),
        dependencies=_dependencies(description, variables, fmi),
        oddities=oddities,
        temporary=temporary,
    )


def _platforms(label: str, folder: Path, fmi: int) -> tuple[str, ...]:
    """The platforms that the FMU holds binaries for, this one among them."""
    binaries = folder / "binaries"
    if fmi == 2:
        wanted, found = platform, supported_platforms(folder)
    else:
        wanted = platform_tuple
        found = sorted(entry.name for entry in binaries.iterdir()) if binaries.is_dir() else []
    if wanted not in found:
        raise FmuError(f"{label}: holds no binary for {wanted}, "
                       + (f"only {', '.join(found)}" if found else "nor for any other platform that FMI names"))
    return tuple(name for name in found if name != "c-code")  # FMPy counts sources too


def _flags(root: Element) -> Iterator[str]:
    """The capability flags that are set; hasEventMode, canGetAndSetFMUState, ..."""
    slave = root.find("CoSimulation")
    for name, value in ({} if slave is None else slave.attrib).items():
        if value in ("true", "1") and str(name).startswith(("can", "has", "provides", "might")):
            yield str(name)


def _dependencies(description: Any, variables: Mapping[str, FmuVariable], fmi: int) -> dict[str, frozenset[str]]:
    """By output the inputs that ModelStructure names; of an array all elements."""
    elements: dict[int, list[str]] = {}
    for variable in variables.values():
        elements.setdefault(variable.reference, []).append(variable.name)

    def names(found: Any) -> list[str]:
        return [found.name] if fmi == 2 else elements.get(found.valueReference, [])

    dependencies: dict[str, frozenset[str]] = {}
    for unknown in description.outputs:
        if unknown.dependencies is not None and unknown.variable is not None:
            givers = frozenset(name for found in unknown.dependencies if found is not None for name in names(found)
                               if variables[name].causality == "input")
            dependencies |= dict.fromkeys(names(unknown.variable), givers)
    return dependencies


def _model_description(label: str, folder: Path) -> tuple[Any, Element, tuple[str, ...]]:
    """What FMPy reads, the document itself for what it leaves out, and the broken rules that harm no run."""
    file = folder / "modelDescription.xml"
    if not file.is_file():
        raise FmuError(f"{label}: holds no modelDescription.xml; it is not an FMU")
    try:
        root = parse_document(file)  # FMPy's parser resolves entities: what declares any is refused before it sees it
        description, oddities = _validated(folder)
        return description, root, oddities
    except DocumentError as error:
        raise FmuError(f"{label}: modelDescription.xml: {error}") from None
    except Exception as error:  # FMPy raises plain Exception for what its schema or rules refuse
        first = str(getattr(error, "problems", [error])[0]).splitlines()[0]
        raise FmuError(f"{label}: modelDescription.xml is not valid: {first}") from None


def _validated(folder: Path) -> tuple[Any, tuple[str, ...]]:
    """What FMPy reads, and what its validation finds, if none of it can harm."""
    try:
        return read_model_description(folder), ()
    except ValidationError as error:
        harmful = [problem for problem in error.problems if not _HARMLESS.search(problem)]
        if harmful:
            raise ValidationError(harmful) from None
        more = f" (and {len(error.problems) - 1} more of this kind)" if len(error.problems) > 1 else ""
        return read_model_description(folder, validate=False), (error.problems[0].rstrip(".") + more,)


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
