"""Driving a model with random inputs, as a Python object and as an FMU, and reading every variable of it."""

from __future__ import annotations

import copy
import functools
import os
import random
import shutil
import tempfile
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback

from threadpitch.fmu import Model, Scalar, Variable, plain_module, read_model, scalars
from threadpitch.fmu.description3 import references

ROOT = Path(__file__).parents[2]
TEST_MODEL = Path(__file__).parent / "models" / "damped_mass.py"
TABLE_MODEL = Path(__file__).parent / "models" / "rotary_table.py"
MODEL_PATHS = [TEST_MODEL, TABLE_MODEL, *sorted((ROOT / "fmu_src").glob("[a-z]*.py"))]
Values = dict[str, float | int | bool]

# How far a random input moves in a step, by unit: enough for saturation, several turns, reversal
_STRIDES = {"m": 2e-3, "rad": 3.0, "rad/s": 20.0, "N.m": 5.0, "N": 100.0}


def names(paths: list[Path]) -> list[str]:
    return [path.stem for path in paths]


def get(instance: Any, scalar: Scalar) -> float | int | bool:
    value = getattr(instance, scalar.variable.name)
    return value if scalar.index is None else value[scalar.index]  # type: ignore[no-any-return]


def put(instance: Any, scalar: Scalar, value: float | int | bool) -> None:
    if scalar.index is None:
        setattr(instance, scalar.variable.name, value)
    else:
        getattr(instance, scalar.variable.name)[scalar.index] = value


def bits(value: float | int | bool) -> str:
    return value.hex() if isinstance(value, float) else repr(value)


def everything(instance: Any, model: Model) -> dict[str, str]:
    """Every variable, bit for bit."""
    return {scalar.name: bits(get(instance, scalar)) for scalar in scalars(model)}


def random_parameters(model: Model, generator: random.Random) -> Values:
    """Parameters away from their start values, as long as the model accepts them."""
    instance = model.model_class()
    chosen: Values = {}
    for scalar in scalars(model):
        variable = scalar.variable
        if variable.causality != "parameter":
            continue
        before = get(instance, scalar)
        value: float | int | bool = before
        if variable.kind == "float":
            value = float(before) * generator.choice([1.0, 0.75, 1.5]) + generator.choice([0.0, 1e-4])
        elif variable.kind == "bool":
            value = generator.random() < 0.5
        elif variable.choices:
            value = generator.choice(sorted(variable.choices.values()))
        inside = (variable.min is None or variable.min <= value) and (variable.max is None or value <= variable.max)
        put(instance, scalar, value)
        if not inside or instance.check() != 0:
            put(instance, scalar, before)
        elif bits(value) != bits(before):
            chosen[scalar.name] = value
    return chosen


def random_inputs(model: Model, count: int, generator: random.Random) -> list[Values]:
    """Inputs for every step: random walks that mostly rise, bools that flip now and then."""
    walk: Values = {scalar.name: scalar.variable.start for scalar in scalars(model)
                    if scalar.variable.causality == "input"}
    found = []
    for _ in range(count):
        for scalar in scalars(model):
            variable = scalar.variable
            if variable.causality != "input":
                continue
            value = walk[scalar.name]
            if variable.kind == "float":
                walk[scalar.name] = value + generator.uniform(-0.3, 1.0) * _STRIDES.get(variable.unit, 1.0)
            elif variable.kind == "bool":
                walk[scalar.name] = bool(value) != (generator.random() < 0.1)
            elif variable.max is not None:
                walk[scalar.name] = min(int(value) + generator.randrange(3), int(variable.max))
        found.append(dict(walk))
    return found


def plain_class(model: Model) -> Callable[[], Any]:
    module = plain_module(model)
    loaded = types.ModuleType(module.name)
    exec(compile(module.text, module.name, "exec"), loaded.__dict__)
    return getattr(loaded, model.class_name)  # type: ignore[no-any-return]


def run_python(model: Model, instance: Any, parameters: Values, inputs: list[Values]) -> list[dict[str, str]]:
    """The trajectory of a Python object; a step that fails leaves the state as it was, as in the FMU."""
    by_name = {scalar.name: scalar for scalar in scalars(model)}
    for name, value in parameters.items():
        put(instance, by_name[name], value)
    assert instance.check() == 0
    instance.initialize()
    step_size = model.experiment.step_size if model.experiment else 0.01
    rows = [everything(instance, model)]
    done = 0  # a step that is refused does not advance time
    for values in inputs:
        for name, value in values.items():
            put(instance, by_name[name], value)
        before = copy.deepcopy(vars(instance))
        try:
            refused = instance.step(done * step_size, step_size) != 0
        except IndexError:
            refused = True
        if refused:
            vars(instance).update(before)
        else:
            done += 1
        rows.append(everything(instance, model))
    return rows


class Fmu:
    """One instance of an FMU in FMPy, with its log."""

    def __init__(self, path: Path, folder: Path, model: Model) -> None:
        self.description = described(path, path.stat().st_mtime_ns)
        self.log: list[str] = []
        self.model = model
        self.by_name = {scalar.name: scalar for scalar in scalars(model)}
        self.slave = FMU2Slave(guid=self.description.guid, unzipDirectory=str(folder),
                               modelIdentifier=model.class_name, instanceName="under_test")
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._logged)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.slave.instantiate(callbacks=callbacks, loggingOn=True)
        self.slave.setupExperiment(startTime=0.0)

    def _logged(self, _environment: Any, _instance: Any, _status: int, _category: Any, message: bytes) -> None:
        self.log.append(message.decode())

    def initialize(self, parameters: Values | None = None) -> None:
        for name, value in (parameters or {}).items():
            self.put(name, value)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def put(self, name: str, value: float | int | bool) -> None:
        scalar = self.by_name[name]
        setter = {"float": self.slave.setReal, "int": self.slave.setInteger, "bool": self.slave.setBoolean}
        setter[scalar.variable.kind]([scalar.reference], [value])

    def get(self, name: str) -> float | int | bool:
        scalar = self.by_name[name]
        getter = {"float": self.slave.getReal, "int": self.slave.getInteger, "bool": self.slave.getBoolean}
        value = getter[scalar.variable.kind]([scalar.reference])[0]
        return bool(value) if scalar.variable.kind == "bool" else value

    def everything(self) -> dict[str, str]:
        return {name: bits(self.get(name)) for name in self.by_name}

    def step(self, number: int, values: Values | None = None) -> None:
        """Set the inputs and do step ``number``; raises FMPy's exception when the FMU refuses."""
        for name, value in (values or {}).items():
            self.put(name, value)
        step_size = self.model.experiment.step_size if self.model.experiment else 0.01
        self.slave.doStep(number * step_size, step_size)


class Fmu3:
    """One instance of an FMU of FMI 3.0 in FMPy, by the names of FMI 2: ``a[2]`` is the second value of ``a``."""

    def __init__(self, path: Path, folder: Path, model: Model, *, events: bool = False) -> None:
        self.description = described(path, path.stat().st_mtime_ns)
        self.log: list[str] = []
        self.model = model
        self.reference = references(model)
        self.slave = FMU3Slave(guid=self.description.instantiationToken, unzipDirectory=str(folder),
                               modelIdentifier=model.class_name, instanceName="under_test")
        self.slave.instantiate(loggingOn=True, eventModeUsed=events, logMessage=fmi3LogMessageCallback(self._logged))

    def _logged(self, _environment: Any, _status: int, _category: Any, message: bytes) -> None:
        self.log.append(message.decode())

    def initialize(self, parameters: Values | None = None) -> None:
        self.put_all(parameters or {})
        self.slave.enterInitializationMode(startTime=0.0)
        self.slave.exitInitializationMode()

    def put_all(self, values: Values) -> None:
        """Set scalars; of an array the elements that are not named keep their value."""
        for variable in self.model.variables:
            named = [name for name in values if name.partition("[")[0] == variable.name]
            if not named:
                continue
            new = self._values(variable)
            for name in named:
                new[int(name.partition("[")[2].rstrip("]") or 1) - 1] = values[name]
            kind = _FMI3_KINDS[variable.kind]
            getattr(self.slave, f"set{kind}")([self.reference[variable.name]], new)

    def _values(self, variable: Variable) -> list[Any]:
        getter = getattr(self.slave, f"get{_FMI3_KINDS[variable.kind]}")
        values = list(getter([self.reference[variable.name]], nValues=variable.size or 1))
        return [bool(value) for value in values] if variable.kind == "bool" else values

    def everything(self) -> dict[str, str]:
        found = {}
        for variable in self.model.variables:
            for index, value in enumerate(self._values(variable), 1):
                found[variable.name if variable.size is None else f"{variable.name}[{index}]"] = bits(value)
        return found

    def step(self, number: int, values: Values | None = None) -> None:
        """Set the inputs and do step ``number``; raises FMPy's exception when the FMU refuses."""
        self.put_all(values or {})
        step_size = self.model.experiment.step_size if self.model.experiment else 0.01
        self.slave.doStep(number * step_size, step_size)


_FMI3_KINDS = {"float": "Float64", "int": "Int32", "bool": "Boolean"}


def advanced(fmu: Fmu | Fmu3, done: int, values: Values) -> int:
    """Do step ``done`` with these inputs; the number of the next step: the same again when the FMU refused it."""
    try:
        fmu.step(done, values)
    except FMICallException as error:
        if "discard" not in str(error):
            raise
        return done
    return done + 1


def run_fmu(fmu: Fmu | Fmu3, parameters: Values, inputs: list[Values]) -> list[dict[str, str]]:
    """The trajectory of an FMU, as ``run_python`` gives that of a Python object."""
    fmu.initialize(parameters)
    rows = [fmu.everything()]
    done = 0
    for values in inputs:
        done = advanced(fmu, done, values)
        rows.append(fmu.everything())
    return rows


@functools.cache
def described(path: Path, _changed: int) -> Any:
    """The description of an FMU, read once: tests open the same one hundreds of times."""
    return read_model_description(str(path))


def unpacked(path: Path) -> Path:
    """The folder beside the FMU that holds what is in it; several workers may ask at once."""
    folder = path.with_suffix("")
    if not folder.exists():
        fresh = tempfile.mkdtemp(dir=path.parent)
        extract(str(path), fresh)
        try:
            os.rename(fresh, folder)
        except OSError:  # another worker was first
            shutil.rmtree(fresh)
    return folder


@contextmanager
def opened(path: Path, model: Model) -> Iterator[Fmu]:
    fmu = Fmu(path, unpacked(path), model)
    try:
        yield fmu
    finally:
        fmu.slave.freeInstance()


@contextmanager
def opened3(path: Path, model: Model, *, events: bool = False) -> Iterator[Fmu3]:
    fmu = Fmu3(path, unpacked(path), model, events=events)
    try:
        yield fmu
    finally:
        fmu.slave.freeInstance()


def read(path: Path) -> Model:
    return read_model(path)
