"""Driving a model with random inputs, as a Python object and as an FMU, and reading every variable of it."""

from __future__ import annotations

import copy
import random
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
from fmpy import extract, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

from threadpitch.fmu import Model, Scalar, plain_module, read_model, scalars

ROOT = Path(__file__).parents[2]
TEST_MODEL = Path(__file__).parent / "models" / "damped_mass.py"
MODEL_PATHS = [TEST_MODEL, *sorted((ROOT / "fmu_src").glob("*.py"))]
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
    for number, values in enumerate(inputs):
        for name, value in values.items():
            put(instance, by_name[name], value)
        before = copy.deepcopy(vars(instance))
        if instance.step(number * step_size, step_size) != 0:
            vars(instance).update(before)
        rows.append(everything(instance, model))
    return rows


class Fmu:
    """One instance of an FMU in FMPy, with its log."""

    def __init__(self, path: Path, folder: Path, model: Model) -> None:
        self.description = read_model_description(str(path))
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


@contextmanager
def opened(path: Path, model: Model) -> Iterator[Fmu]:
    folder = Path(extract(str(path), str(path.with_suffix("")))) if not path.with_suffix("").exists() \
        else path.with_suffix("")
    fmu = Fmu(path, folder, model)
    try:
        yield fmu
    finally:
        fmu.slave.freeInstance()


def read(path: Path) -> Model:
    return read_model(path)
