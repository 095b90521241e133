"""What an FMU says of itself: its variables, units and abilities, as plain typed values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fmpy import platform, platform_tuple, read_model_description, supported_platforms

from threadpitch.cosim.archive import TemporaryFolder, unpack
from threadpitch.cosim.document import DocumentError, Element, parse_document
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.variable import FmuVariable
from threadpitch.cosim.variables import read_variables, to_number
from threadpitch.units import BASES, Unit, UnitError, unit


class FmuError(CosimError):
    """A file is not an FMU that can be run here."""


@dataclass(frozen=True)
class FmuDescription:
    """An unpacked FMU of FMI version ``fmi``; ``units`` are those that it defines itself, display units included.

    ``guid`` is FMI 3.0's instantiationToken too.
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
    fmi: int = 2
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


def read_fmu(path: Path) -> FmuDescription:
    """Unpack an FMU into a temporary folder and read its description.

    Raises:
        ArchiveError: the file is missing or not a sound archive.
        FmuError: the description is missing or wrong, the FMU is not FMI 2.0 or 3.0 for co-simulation, or it holds
            no binary for this platform.
    """
    temporary = unpack(path)
    folder = temporary.path
    description, root = _model_description(path, folder)
    fmi = {"2": 2, "3": 3}.get(str(description.fmiVersion).partition(".")[0])
    if fmi is None:
        raise FmuError(f"{path}: is FMI {description.fmiVersion}; only FMI 2.0 and 3.0 co-simulation can be run")
    slave = description.coSimulation
    if slave is None:
        raise FmuError(f"{path}: offers model exchange only; export it for co-simulation")
    _check_platform(path, folder, fmi)
    experiment = description.defaultExperiment
    return FmuDescription(
        path=path,
        folder=folder,
        guid=description.guid,
        model_identifier=slave.modelIdentifier,
        variables={found.name: found for found in read_variables(description, root)},
        units=_units(description),
        log_categories=tuple(category.name for category in description.logCategories),
        step_size=to_number(experiment.stepSize) if experiment is not None else None,
        once_per_process=slave.canBeInstantiatedOnlyOncePerProcess,
        fmi=fmi,
        temporary=temporary,
    )


def _check_platform(path: Path, folder: Path, fmi: int) -> None:
    if fmi == 2:
        wanted, found = platform, supported_platforms(folder)
    else:
        wanted = platform_tuple
        binaries = folder / "binaries"
        found = sorted(entry.name for entry in binaries.iterdir()) if binaries.is_dir() else []
    if wanted not in found:
        raise FmuError(f"{path}: holds no binary for {wanted}, only {', '.join(found) or 'none'}")


def _model_description(path: Path, folder: Path) -> tuple[Any, Element]:
    """What FMPy reads, and the document itself for what it leaves out."""
    file = folder / "modelDescription.xml"
    if not file.is_file():
        raise FmuError(f"{path}: holds no modelDescription.xml; it is not an FMU")
    try:
        root = parse_document(file)  # FMPy's parser resolves entities: what declares any is refused before it sees it
        return read_model_description(folder), root
    except DocumentError as error:
        raise FmuError(f"{path}: modelDescription.xml: {error}") from None
    except Exception as error:  # FMPy raises plain Exception for what its schema or rules refuse
        first = str(getattr(error, "problems", [error])[0]).splitlines()[0]
        raise FmuError(f"{path}: modelDescription.xml is not valid: {first}") from None


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
