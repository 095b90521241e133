"""Reference results that every FMU carries: a short run of the Python class, with the inputs that drive it.

``<Class>_in.csv`` holds the inputs, each row constant from its time to the next; ``<Class>_ref.csv`` the outputs after
initialisation (first row) and after every step; ``<Class>_ref.opt`` the options, as in the FMI cross-check. Numbers are
written so that they read back bit for bit. Where the model refuses a step, the outputs end before it and the inputs
hold that step's row too: an FMU that computes the step differs from the Python class.
"""

from __future__ import annotations

import functools
import random
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from threadpitch.fmu.declaration import INTEGER_GREATEST, INTEGER_LEAST
from threadpitch.fmu.effort import MOST_LINES, BoundedEffort, EffortError
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
    inputs: tuple[Row, ...]  # (steps,), or (steps + 1,) where the step after the last is refused
    outputs: tuple[Row, ...]  # (steps + 1,)
    refusal: str | None = None  # why and where the run ended early

    @property
    def steps(self) -> int:
        """How many steps were computed."""
        return len(self.outputs) - 1

    @property
    def stop_time(self) -> float:
        """The last time, s."""
        return self.steps * self.step_size


@functools.lru_cache(maxsize=16)
def reference(model: Model) -> Reference:
    """Run the Python class with the start values as parameters; a step that it refuses ends the run.

    Raises:
        ModelError: the model does not initialise with its start values, or refuses the first step.
    """
    run = _Run(model)
    rows = _inputs(model)
    try:
        with BoundedEffort(model.path):
            run.initialize(rows[0])
            for row in rows:
                run.step(row)
                if run.refusal is not None:
                    break
        inputs = rows[:len(run.found)]
    except EffortError as error:
        run.refusal = f"no end after {MOST_LINES} lines, {model.text.place(error.line)}; mend the loop there"
        inputs = rows[:max(len(run.found) - 1, 0)]
    if run.refusal is not None and len(run.found) < 2:
        doing = "the first step" if run.found else "the initialization"
        raise ModelError(f"{model.path}: {doing} cannot be computed with the start values and the default experiment: "
                         f"{run.refusal}")
    return Reference(run.step_size, tuple(inputs), tuple(run.found), run.refusal)


def refusal(model: Model) -> str | None:
    """What to say of a model that does not run its default experiment; None where it does.

    Raises:
        ModelError: as ``reference``.
    """
    results = reference(model)
    if results.refusal is None:
        return None
    return (f"{model.path}: the default experiment is refused at {results.stop_time:.9g} s: {results.refusal}; "
            "the reference results end there")


class _Run:
    """The Python class on its way through the reference inputs."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.instance = model.model_class()
        self.scalars = scalars(model)
        self.step_size = model.experiment.step_size if model.experiment else _STEP_SIZE
        self.found: list[Row] = []  # the outputs
        self.refusal: str | None = None

    def initialize(self, row: Row) -> None:
        """Check the start values and initialize with them."""
        self._put(row)
        where = f"{self.model.path}: "
        problem = self._problem(self.instance.check)
        if problem is not None:
            raise ModelError(f"{where}check() refuses the start values: {problem}")
        problem = self._problem(self.instance.initialize)
        if problem is not None:
            raise ModelError(f"{where}the initialization with the start values: {problem}; mend the start values")
        self.found.append(self._outputs())

    def step(self, row: Row) -> None:
        """Do the next step, or set ``refusal``."""
        self._put(row)
        time = (len(self.found) - 1) * self.step_size
        self.refusal = self._problem(lambda: self.instance.step(time, self.step_size))
        if self.refusal is None:
            self.found.append(self._outputs())

    def _problem(self, action: Callable[[], int | None]) -> str | None:
        """Why the model cannot do this, with the line where it raised; None where it did it."""
        try:
            number = action() or 0
        except (ArithmeticError, ValueError, IndexError) as error:
            lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__)
                     if frame.filename == str(self.model.path)]
            return f"{type(error).__name__}: {error}, {self.model.text.place(lines[-1] or 1 if lines else 1)}"
        if number != 0:
            return self.model.errors.get(number, f"the model returns {number}, which ERRORS does not declare")
        return self._too_large()

    def _too_large(self) -> str | None:
        """FMI passes integers in 32 bits."""
        for scalar in self.scalars:
            if scalar.variable.kind == "int" and scalar.variable.causality in ("output", "local"):
                value = self._value(scalar)
                if not INTEGER_LEAST <= value <= INTEGER_GREATEST:
                    return f"{scalar.name} is {value}, beyond the 32 bits of an FMI integer"
        return None

    def _put(self, row: Row) -> None:
        for scalar in self.scalars:
            if scalar.name not in row:
                continue
            if scalar.index is None:
                setattr(self.instance, scalar.variable.name, row[scalar.name])
            else:
                getattr(self.instance, scalar.variable.name)[scalar.index] = row[scalar.name]

    def _value(self, scalar: Scalar) -> Number:
        value: Any = getattr(self.instance, scalar.variable.name)
        found: Number = value if scalar.index is None else value[scalar.index]
        return found

    def _outputs(self) -> Row:
        return {scalar.name: self._value(scalar) for scalar in self.scalars if scalar.variable.causality == "output"}


def reference_entries(model: Model) -> dict[str, bytes]:
    """The files of the reference results, for the FMU's archive.

    Raises:
        ModelError: as ``reference``.
    """
    results = reference(model)
    step_size = results.step_size
    options = {"StartTime": 0.0, "StopTime": results.stop_time, "StepSize": step_size, "RelTol": 0.0}
    return {
        f"{FOLDER}/{model.class_name}_in.csv": _table(results.inputs, step_size),
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


def _table(rows: Iterable[Row], step_size: float) -> bytes:
    lines = []
    for number, row in enumerate(rows):
        if number == 0:
            lines.append(",".join(f'"{name}"' for name in ("time", *row)))
        lines.append(",".join((repr(number * step_size), *(_written(value) for value in row.values()))))
    return ("\n".join(lines) + "\n").encode()


def _written(value: Number) -> str:
    return str(int(value)) if isinstance(value, bool) else repr(value)
