"""Reference results that every FMU carries: a short run of the Python class, with the inputs that drive it.

``<Class>_in.csv`` holds the inputs, each row constant from its time to the next; ``<Class>_ref.csv`` the outputs after
initialisation (first row) and after every step; ``<Class>_ref.opt`` the options, as in the FMI cross-check. Numbers are
written so that they read back bit for bit.
"""

from __future__ import annotations

import copy
import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from threadpitch.fmu.model import Model, Scalar, scalars
from threadpitch.fmu.variable import ModelError

FOLDER = "documentation/reference"
STEPS = 100
_STEP_SIZE = 0.01  # s, of a model without a default experiment
_SEED = 1
# Largest movement of an input in one step, by unit: what a machine tool does in a millisecond or ten
_STRIDES = {"m": 2e-5, "rad": 0.1, "rad/s": 0.5, "N.m": 0.5, "N": 10.0}
_STRIDE = 0.1  # of other units
_RISE = (-0.3, 1.0)  # of a stride: the walks mostly rise, so that axes move and spindles turn
_FLIP = 0.05  # probability that a bool changes

Number = float | int | bool
Row = Mapping[str, Number]


@dataclass(frozen=True)
class Reference:
    """Inputs of every step, and outputs after initialisation and after every step, by the names of FMI 2."""

    step_size: float  # s
    inputs: tuple[Row, ...]  # (steps,)
    outputs: tuple[Row, ...]  # (steps + 1,)


def reference(model: Model) -> Reference:
    """Run the Python class with the start values as parameters; a step that it refuses ends the run.

    Raises:
        ModelError: the model does not initialise with its start values.
    """
    instance = model.model_class()
    all_scalars = scalars(model)
    outputs = [scalar for scalar in all_scalars if scalar.variable.causality == "output"]
    rows = _inputs(model)
    step_size = model.experiment.step_size if model.experiment else _STEP_SIZE
    _put(instance, all_scalars, rows[0])
    try:
        number = instance.check()
        instance.initialize()
    except (ArithmeticError, ValueError, IndexError) as error:
        raise ModelError(f"{model.path}: {type(error).__name__} in the initialization with the start values: {error}; "
                         "mend the start values") from error
    if number != 0:
        raise ModelError(f"{model.path}: check() refuses the start values: {model.errors.get(number, number)}")
    found = [_get(instance, outputs)]
    for step, row in enumerate(rows):
        _put(instance, all_scalars, row)
        before = copy.deepcopy(vars(instance))
        try:
            number = instance.step(step * step_size, step_size)
        except (ArithmeticError, ValueError, IndexError):
            number = -1
        if number != 0:
            vars(instance).update(before)
            break
        found.append(_get(instance, outputs))
    return Reference(step_size, tuple(rows[:len(found) - 1]), tuple(found))


def reference_entries(model: Model) -> dict[str, bytes]:
    """The files of the reference results, for the FMU's archive.

    Raises:
        ModelError: the model does not initialise with its start values.
    """
    results = reference(model)
    step_size, steps = results.step_size, len(results.inputs)
    options = {"StartTime": 0.0, "StopTime": steps * step_size, "StepSize": step_size, "RelTol": 0.0}
    # without a step the inputs of the initialisation still stand there
    inputs = results.inputs or (_inputs(model)[0],)
    return {
        f"{FOLDER}/{model.class_name}_in.csv": _table(inputs, step_size),
        f"{FOLDER}/{model.class_name}_ref.csv": _table(results.outputs, step_size),
        f"{FOLDER}/{model.class_name}_ref.opt": "".join(f"{name}, {value!r}\n" for name, value in options.items())
                                                  .encode(),
    }


def _inputs(model: Model) -> list[dict[str, Number]]:
    """Random walks of the inputs, the same on every machine: Python's generator is fixed by its seed."""
    generator = random.Random(_SEED)
    driven = [scalar for scalar in scalars(model) if scalar.variable.causality == "input"]
    walk: dict[str, Number] = {scalar.name: scalar.variable.start for scalar in driven}
    rows = [dict(walk)]
    for _ in range(STEPS - 1):
        for scalar in driven:
            walk[scalar.name] = _moved(walk[scalar.name], scalar, generator)
        rows.append(dict(walk))
    return rows


def _moved(value: Number, scalar: Scalar, generator: random.Random) -> Number:
    variable = scalar.variable
    if variable.kind == "bool":
        return bool(value) != (generator.random() < _FLIP)
    if variable.kind == "int":
        moved: Number = int(value) + int(generator.random() * 2.0)
    else:
        low, high = _RISE
        moved = float(value) + (low + (high - low) * generator.random()) * _STRIDES.get(variable.unit, _STRIDE)
    inside = (variable.min is None or variable.min <= moved) and (variable.max is None or moved <= variable.max)
    return moved if inside else value


def _put(instance: Any, all_scalars: Iterable[Scalar], row: Row) -> None:
    for scalar in all_scalars:
        if scalar.name not in row:
            continue
        if scalar.index is None:
            setattr(instance, scalar.variable.name, row[scalar.name])
        else:
            getattr(instance, scalar.variable.name)[scalar.index] = row[scalar.name]


def _get(instance: Any, wanted: Iterable[Scalar]) -> dict[str, Number]:
    row = {}
    for scalar in wanted:
        value = getattr(instance, scalar.variable.name)
        row[scalar.name] = value if scalar.index is None else value[scalar.index]
    return row


def _table(rows: Iterable[Row], step_size: float) -> bytes:
    lines = []
    for number, row in enumerate(rows):
        if number == 0:
            lines.append(",".join(f'"{name}"' for name in ("time", *row)))
        lines.append(",".join((repr(number * step_size), *(_written(value) for value in row.values()))))
    return ("\n".join(lines) + "\n").encode()


def _written(value: Number) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)
