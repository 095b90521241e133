"""Reading of System Structure and Parameterization 1.0 and 2.0: a folder, an .ssd, an .ssp -> ``System``.

SSD with nested systems (inline, by reference to an .ssd, an .ssp or an id), SSV, SSM and SSB, each inline or in a file
of its own. The reading itself is our own: FMPy's reader knows SSP 1.0, wants a ZIP archive and drops connector types
and units, ``suppressUnitConversion``, the units of parameter sets and (it looks in the wrong namespace) every
LinearTransformation; pyssp_standard 0.9.1 reads SSP 2.0 with the schemas of 1.0 and drops the connections'
transformations, their ``suppressUnitConversion`` and arrays. Both would have changed results in silence; their
schemas are used.

``schema`` parses and validates, ``content`` reads what all files share, ``parameters`` SSV and SSM, ``reader`` makes
blocks of SSDs, and ``flat`` lays them flat.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path

from threadpitch.cosim.ssp.content import Definitions, number
from threadpitch.cosim.ssp.flat import Flat
from threadpitch.cosim.ssp.parameters import parameter_values
from threadpitch.cosim.ssp.reader import FMU_TYPE, Locate, Place, Reader, Session
from threadpitch.cosim.ssp.schema import SSB, SSC, SSD, SSM, SSV, parse
from threadpitch.cosim.system import Annotation, ParameterValue, System, SystemStructureError, nearest

__all__ = ["FMU_TYPE", "SSB", "SSC", "SSD", "SSM", "SSV", "Locate", "locate_file", "read_parameter_set", "read_system",
           "read_with_problems"]

NAME = "SystemStructure.ssd"
# The step size that a tool notes of the whole system, or of its default experiment: by owner and type of the
# annotation the element and its attribute.
_STEP_SIZES = {("", "org.openmodelica"): ("FixedStepMaster", "stepSize"),
               ("DefaultExperiment", "com.opensimulationplatform"): ("FixedStepAlgorithm", "baseStepSize")}


def read_system(path: str | Path, *, locate: Locate | None = None,
                replace: Mapping[str, str | Path] | None = None) -> System:
    """Read a system from a folder with SystemStructure.ssd, from an .ssd file or from an .ssp archive.

    ``locate(source, base)`` gives the FMU file for a component's source; ``base`` is the SSD's folder. Without it the
    file must lie at ``base / source``. ``replace`` names by component an FMU to run instead of the SSD's. An .ssp is
    unpacked to a temporary folder that ``System.close`` removes.

    Raises:
        SystemStructureError: the file is missing, is not an SSD or breaks its schema, names what is not supported, or
            refers to a file that does not exist or lies outside of its folder; every problem is in its ``problems``.
        ArchiveError: the .ssp is not a sound archive.
    """
    system, problems = read_with_problems(path, locate=locate, replace=replace)
    if problems:
        system.close()
        raise SystemStructureError(*problems)
    return system


def read_with_problems(path: str | Path, *, locate: Locate | None = None,
                       replace: Mapping[str, str | Path] | None = None) -> tuple[System, tuple[str, ...]]:
    """A system as far as it can be read, and what is wrong with it; components without FMU have the path ``.``.

    Raises:
        SystemStructureError, ArchiveError: as ``read_system``, where there is no SSD to begin with.
    """
    session = Session(locate or locate_file, {name: Path(fmu) for name, fmu in (replace or {}).items()})
    try:
        return _system(Path(path), session)
    except BaseException:
        for folder in session.folders:
            folder.close()
        raise


def read_parameter_set(path: str | Path) -> tuple[ParameterValue, ...]:
    """The values of an .ssv file, in its order; names are ``component.variable``.

    Raises:
        SystemStructureError: the file is missing, is not an SSV or breaks its schema.
    """
    path = Path(path)
    return parameter_values(parse(path, str(path), f"{SSV}ParameterSet"), str(path), Definitions({}, {}))


def locate_file(source: str, base: Path) -> Path:
    """``base / source``, which must be a file.

    Raises:
        SystemStructureError: there is no such file.
    """
    path = base / source
    if not path.is_file():
        raise SystemStructureError(f"FMU {source!r} does not lie beside the SSD; put it there or mend the source")
    return path


def _system(path: Path, session: Session) -> tuple[System, tuple[str, ...]]:
    reader = Reader(_find(path, session), session)
    block = reader.block()
    flat = Flat(block)
    connections = tuple(flat.connections())
    problems = [*session.problems, *flat.problems, *_unused(session)]
    if not flat.components and not problems:
        problems.append(f"{reader.place.name}: the system holds no component")
    experiment = reader.root.find(f"{SSD}DefaultExperiment")
    system = System(
        name=reader.root.get("name", block.name),
        components=flat.components,
        connections=connections,
        parameter_values=block.values,
        connectors=flat.connectors,
        units=reader.definitions.units,
        start_time=number(experiment, "startTime") or 0.0,
        stop_time=number(experiment, "stopTime"),
        step_size=_step_size(session.annotations),
        path=path,
        annotations=tuple(session.annotations),
        notes=tuple(session.notes),
        folders=tuple(session.folders),
    )
    return system, tuple(dict.fromkeys(problems))


def _find(path: Path, session: Session) -> Place:
    """Where the SSD is. People know the archive, not the temporary folder: messages name the former."""
    if path.suffix.lower() == ".ssp" and not path.is_dir():
        place = Place(session.unpack(path, str(path)) / NAME, path.name, path.name)
    else:
        ssd = path / NAME if path.is_dir() else path
        place = Place(ssd, str(ssd))
    if not place.ssd.is_file():
        wrong = f"{path}: holds no {NAME}" if path.is_dir() or place.archive else f"{path}: no such file"
        raise SystemStructureError(f"{wrong}; give an .ssp, an .ssd or a folder with {NAME}")
    return place


def _unused(session: Session) -> list[str]:
    return [f"replacement: no component {name!r}{nearest(name, session.names)}" for name in session.replace
            if name not in session.names]


def _step_size(annotations: list[Annotation]) -> float | None:
    """The step that the annotations of OMSimulator, libcosim or Ecos state; SSP itself has no word for it."""
    for found in annotations:
        mark = _STEP_SIZES.get((found.owner, found.type))
        element, attribute = mark or ("", "")
        match = re.search(rf'{element}\b[^<>]*\b{attribute}\s*=\s*"([^"]*)"', found.content) if mark else None
        try:
            step = float(match[1]) if match else 0.0
        except ValueError:
            continue
        if 0.0 < step < math.inf:
            return step
    return None
