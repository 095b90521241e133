"""Built FMUs against the reference results that they carry: every output, bit for bit."""

from __future__ import annotations

import csv
import io
import math
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback

from threadpitch.fmu.reference import FOLDER

_KINDS2 = {"Real": "Real", "Integer": "Integer", "Boolean": "Boolean"}
_KINDS3 = {"Float64": "Float64", "Int32": "Int32", "Boolean": "Boolean"}


_DISCARD = 2  # fmi2Discard and fmi3Discard


@dataclass(frozen=True)
class _Table:
    names: tuple[str, ...]
    times: tuple[float, ...]  # s
    rows: tuple[tuple[float, ...], ...]  # (times, names)


@dataclass(frozen=True)
class _Results:
    """The reference results: see ``threadpitch.fmu.reference``."""

    inputs: _Table
    outputs: _Table

    @property
    def refuses(self) -> bool:
        """Whether the step after the last is refused."""
        return len(self.inputs.rows) == len(self.outputs.rows)


def check_built(fmu: Path | str) -> list[str]:
    """Run an FMU with its reference inputs on this machine; one line for everything that differs, none if nothing.

    A library that is not there for this machine, and reference results that are missing, are such lines too.
    """
    path = Path(fmu)
    folder = Path(tempfile.mkdtemp(prefix="threadpitch-"))
    try:
        try:
            fmpy.extract(str(path), str(folder))
            description = read_model_description(str(folder))
        except Exception as error:  # FMPy raises bare Exception for what is no FMU
            return [f"{path}: the FMU cannot be read ({error}); build it again"]
        return [f"{path}: {problem}" for problem in _problems(folder, description)]
    finally:
        shutil.rmtree(folder, ignore_errors=True)  # Windows keeps a loaded library


def _problems(folder: Path, description: Any) -> Iterator[str]:
    name = description.coSimulation.modelIdentifier
    version2 = description.fmiVersion == "2.0"
    platform = fmpy.platform if version2 else fmpy.platform_tuple
    if not (folder / "binaries" / platform / f"{name}{fmpy.sharedLibraryExtension}").is_file():
        yield f"it holds no library for {platform}; build it for this platform"
        return
    log: list[str] = []
    try:
        results = _results(folder / FOLDER, name)
    except (OSError, ValueError) as error:
        yield f"its reference results cannot be read ({error}); build it again"
        return
    try:
        yield from _differences((_Slave2 if version2 else _Slave3)(folder, description, log), results)
    except Exception as error:  # FMPy raises bare Exception for the FMU's refusals
        yield f"it does not run ({log[-1] if log else error}); build it again"


def _differences(slave: _Slave2, results: _Results) -> Iterator[str]:
    """The first difference of every output, and a step that the reference refuses and the FMU computes."""
    differing: set[str] = set()
    inputs, outputs = results.inputs, results.outputs
    try:
        slave.put(inputs.names, inputs.rows[0])
        slave.initialize()
        for number, (time, expected) in enumerate(zip(outputs.times, outputs.rows, strict=True)):
            if number > 0:
                slave.put(inputs.names, inputs.rows[number - 1])
                slave.slave.doStep(outputs.times[number - 1], outputs.times[1] - outputs.times[0])
            for name, found, wanted in zip(outputs.names, slave.get(outputs.names), expected, strict=True):
                if not _same(found, wanted) and name not in differing:
                    differing.add(name)
                    yield f"{name} is {found!r} at {time!r} s where the reference has {wanted!r}"
        if results.refuses and _computes(slave, results):
            yield (f"the step from {outputs.times[-1]!r} s is computed where Python refuses it; guard the model: no "
                   "index outside, no division by zero, no root of a negative number")
    finally:
        slave.slave.freeInstance()


def _computes(slave: _Slave2, results: _Results) -> bool:
    """Whether the FMU computes the step after the last."""
    times = results.outputs.times
    slave.put(results.inputs.names, results.inputs.rows[-1])
    try:
        slave.slave.doStep(times[-1], times[1] - times[0])
    except FMICallException as error:
        if error.status != _DISCARD:
            raise
        return False
    return True


def _same(one: float, other: float) -> bool:
    return one == other or (math.isnan(one) and math.isnan(other))


class _Slave2:
    """An FMU of FMI 2.0 by the names of its scalars."""

    def __init__(self, folder: Path, description: Any, log: list[str]) -> None:
        self.log = log
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self.slave = self._instantiated(folder, description)

    def _instantiated(self, folder: Path, description: Any) -> Any:
        slave = FMU2Slave(guid=description.guid, unzipDirectory=str(folder), instanceName="check",
                          modelIdentifier=description.coSimulation.modelIdentifier)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._logged)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        slave.instantiate(callbacks=callbacks, loggingOn=True)
        slave.setupExperiment(startTime=0.0)
        return slave

    def _logged(self, *message: Any) -> None:
        self.log.append(message[-1].decode(errors="replace"))

    def initialize(self) -> None:
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def put(self, names: Sequence[str], values: Sequence[float]) -> None:
        for name, value in zip(names, values, strict=True):
            variable = self.variables[name]
            kind = int if variable.type in ("Integer", "Boolean") else float
            getattr(self.slave, f"set{variable.type}")([variable.valueReference], [kind(value)])

    def get(self, names: Sequence[str]) -> list[float]:
        found = []
        for name in names:
            variable = self.variables[name]
            found.append(float(getattr(self.slave, f"get{variable.type}")([variable.valueReference])[0]))
        return found


class _Slave3(_Slave2):
    """An FMU of FMI 3.0 by the same names: ``a[2]`` is the second value of the array ``a``."""

    def _instantiated(self, folder: Path, description: Any) -> Any:
        self.arrays: dict[str, list[float]] = {}
        slave = FMU3Slave(guid=description.instantiationToken, unzipDirectory=str(folder), instanceName="check",
                          modelIdentifier=description.coSimulation.modelIdentifier)
        slave.instantiate(loggingOn=True, logMessage=fmi3LogMessageCallback(self._logged))
        return slave

    def initialize(self) -> None:
        self.slave.enterInitializationMode(startTime=0.0)
        self.slave.exitInitializationMode()

    def put(self, names: Sequence[str], values: Sequence[float]) -> None:
        for name, values_of in _grouped(names, values).items():
            variable = self.variables[name]
            kind = {"Float64": float, "Int32": int, "Boolean": bool}[variable.type]
            getattr(self.slave, f"set{variable.type}")([variable.valueReference], [kind(one) for one in values_of])

    def get(self, names: Sequence[str]) -> list[float]:
        found: list[float] = []
        for name, wanted in _grouped(names, [0.0] * len(names)).items():
            variable = self.variables[name]
            values = getattr(self.slave, f"get{variable.type}")([variable.valueReference], nValues=len(wanted))
            found += [float(value) for value in values]
        return found


def _grouped(names: Sequence[str], values: Sequence[float]) -> dict[str, list[float]]:
    """The values of every variable; the elements of an array stand beside each other in their order."""
    found: dict[str, list[float]] = {}
    for name, value in zip(names, values, strict=True):
        found.setdefault(name.partition("[")[0], []).append(value)
    return found


def _results(folder: Path, name: str) -> _Results:
    """The reference results in a folder.

    Raises:
        OSError, ValueError: a file is missing, or does not fit the others.
    """
    found = _Results(*(_read(folder / f"{name}_{part}.csv") for part in ("in", "ref")))
    steps = len(found.outputs.rows) - 1
    if len(found.inputs.rows) not in (steps, steps + 1) or steps < 1:
        raise ValueError(f"{name}_in.csv holds {len(found.inputs.rows)} rows for the {steps} steps of {name}_ref.csv")
    stop_time = _options(folder / f"{name}_ref.opt").get("StopTime", math.nan)
    if found.outputs.times[-1] != stop_time:
        raise ValueError(f"{name}_ref.csv ends at {found.outputs.times[-1]!r} s, and {name}_ref.opt has the StopTime "
                         f"{stop_time!r} s")
    return found


def _read(path: Path) -> _Table:
    with io.StringIO(path.read_text(encoding="utf-8")) as stream:
        header, *lines = list(csv.reader(stream)) or [[]]
    for number, line in enumerate(lines, 2):
        if len(line) != len(header):
            raise ValueError(f"line {number} of {path.name} holds {len(line)} cells, and the header {len(header)}")
    numbers = [tuple(float(cell) for cell in line) for line in lines]
    if not numbers:
        raise ValueError(f"{path.name} holds no row")
    return _Table(tuple(header[1:]), tuple(row[0] for row in numbers), tuple(row[1:] for row in numbers))


def _options(path: Path) -> dict[str, float]:
    pairs = (line.partition(",") for line in path.read_text(encoding="utf-8").splitlines())
    return {name.strip(): float(value) for name, _, value in pairs}
