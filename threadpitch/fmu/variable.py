"""The declaration: a model's variables are the fields of an ordinary dataclass.

    screw_lead: float = parameter("m", "Ball-screw lead", start=0.010, display="mm", min=1e-4)

Each function returns a dataclass field that carries a ``Variable``. Types are ``float``, ``int`` and ``bool``; with
``size=n`` the field is a ``list`` of n of them (FMI 2: ``name[1]`` to ``name[n]``, FMI 3: a native array).
Numbers are SI; ``unit`` is their SI unit and ``display`` the unit that people read.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

KEY = "threadpitch"  # of the field's metadata


class ModelError(ValueError):
    """A model file does not declare a model, or leaves what can be built; the message has file, line and mend."""


@dataclass(frozen=True)
class Variable:
    """One declared variable; ``name`` and ``kind`` ("float", "int" or "bool") come from the dataclass field."""

    causality: str  # "parameter" | "input" | "output" | "local"
    unit: str
    description: str
    start: float | int | bool
    display: str | None = None
    min: float | int | None = None
    max: float | int | None = None
    nominal: float | None = None
    size: int | None = None
    discrete: bool = False
    choices: Mapping[str, int] | None = None
    depends_on: tuple[str, ...] = ()
    derivatives: tuple[str, ...] = ()  # of an input: the states that take its first and second time derivative
    derivative: str | None = None  # of an output: the variable that is its time derivative
    name: str = ""
    kind: str = "float"


@dataclass(frozen=True)
class Experiment:
    """The default experiment of a model: module constant ``EXPERIMENT`` beside the dataclass. Seconds."""

    stop_time: float
    step_size: float
    start_time: float = 0.0


@dataclass(frozen=True)
class Clock:
    """A clock of FMI 3 in the module constant ``CLOCKS = (Clock(...),)``: triggered by the model, an output.

    It ticks at the end of a step after which ``ticks``, an int, is not 0; of an array its ``element``, from 0.
    """

    name: str
    ticks: str
    element: int = 0
    description: str = ""


@dataclass(frozen=True)
class Terminal:
    """What belongs together (FMI 3), in the module constant ``TERMINALS = (Terminal(...),)``.

    ``members`` maps the name of a member to the variable: two terminals fit where the names of their members agree.
    """

    name: str
    members: Mapping[str, str]
    description: str = ""


def _field(variable: Variable) -> Any:
    metadata = {KEY: variable}
    if variable.size is None:
        return dataclasses.field(default=variable.start, metadata=metadata)
    start, size = variable.start, variable.size
    return dataclasses.field(default_factory=lambda: [start] * size, metadata=metadata)


def parameter(unit: str, description: str, *, start: float | int | bool, display: str | None = None,
              min: float | int | None = None, max: float | int | None = None, nominal: float | None = None,
              size: int | None = None, choices: Mapping[str, int] | None = None) -> Any:
    """A parameter: fixed before initialisation ends. ``choices`` names the values of an int: ``{"ball_screw": 1}``."""
    if choices is not None:
        min, max = _least(choices), _greatest(choices)
    return _field(Variable("parameter", unit, description, start, display, min, max, nominal, size, choices=choices))


def input_(unit: str, description: str, *, start: float | int | bool = 0.0, display: str | None = None,
           min: float | int | None = None, max: float | int | None = None, nominal: float | None = None,
           size: int | None = None, discrete: bool = False, derivatives: tuple[str, ...] = ()) -> Any:
    """An input: constant during a step, valid at its end when the master steps in the order of the data.

    ``derivatives`` names the states that take its first and second time derivative, u' and u'': the model evaluates
    u + u' tau + u''/2 tau^2 with tau the time since the step began. An importer that gives none leaves them 0.
    """
    return _field(Variable("input", unit, description, start, display, min, max, nominal, size, discrete,
                           derivatives=derivatives))


def output(unit: str, description: str, *, start: float | int | bool = 0.0, display: str | None = None,
           min: float | int | None = None, max: float | int | None = None, nominal: float | None = None,
           size: int | None = None, discrete: bool = False, depends_on: tuple[str, ...] = (),
           derivative: str | None = None) -> Any:
    """An output: calculated by ``initialize`` and at the end of every step.

    ``depends_on`` names the inputs that it depends on directly: its value at the end of a step changes with theirs.
    ``derivative`` names the variable that is its time derivative.
    """
    return _field(Variable("output", unit, description, start, display, min, max, nominal, size, discrete,
                           depends_on=depends_on, derivative=derivative))


def state(unit: str, description: str, *, start: float | int | bool = 0.0, display: str | None = None,
          min: float | int | None = None, max: float | int | None = None, nominal: float | None = None,
          size: int | None = None, discrete: bool = False) -> Any:
    """A state: what the model remembers from step to step; saved and restored with the FMU's state."""
    return _field(Variable("local", unit, description, start, display, min, max, nominal, size, discrete))


def _least(choices: Mapping[str, int]) -> int:
    return sorted(choices.values())[0]


def _greatest(choices: Mapping[str, int]) -> int:
    return sorted(choices.values())[-1]
