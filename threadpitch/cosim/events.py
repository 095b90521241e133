"""What a run waits for: a variable that passes a level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from threadpitch.cosim.check import Plan
from threadpitch.cosim.system import Value, nearest
from threadpitch.cosim.values import VariableValueError, from_si
from threadpitch.cosim.variable import FmuVariable

DIRECTIONS = ("both", "rising", "falling")


@dataclass(frozen=True)
class Event:
    """A variable passes a level: ``Event("spindle.angle", "90deg", "rising")``.

    ``variable`` is ``component.variable``; a Boolean is 0 or 1 (level 0.5), ``level`` a number in SI or a text with a
    unit. A communication point is set where it happens.
    """

    variable: str
    level: Value = 0.0
    direction: str = "both"


class EventRecord(NamedTuple):
    """An event that happened: when [s], and which."""

    time: float
    variable: str
    direction: str


class Level(NamedTuple):
    """An event of a system: its variable, and the level in that variable's unit."""

    event: Event
    component: str
    variable: FmuVariable
    level: float


def find_levels(events: Sequence[Event], plan: Plan) -> tuple[Level, ...]:
    """The events of a system.

    Raises:
        VariableValueError: a variable is not there, or a level does not fit it.
    """
    return tuple(Level(event, *find_variable(event, plan), level_of(event, plan)) for event in events)


def find_variable(event: Event, plan: Plan) -> tuple[str, FmuVariable]:
    """The component and variable that an event names.

    Raises:
        VariableValueError: there is none, or it has no numbers.
    """
    component, _, name = event.variable.partition(".")
    if component not in plan.descriptions:
        raise VariableValueError(f"no component {component!r}{nearest(component, plan.order)}")
    variables = plan.descriptions[component].variables
    if name not in variables:
        raise VariableValueError(f"{component} has no variable {name!r}{nearest(name, variables)}")
    if not variables[name].exchanged:
        raise VariableValueError(f"{event.variable} is {variables[name].type}, which has no level")
    return component, variables[name]


def level_of(event: Event, plan: Plan) -> float:
    """The level in the variable's own unit.

    Raises:
        VariableValueError: the variable is not there, or the level does not fit it.
    """
    component, variable = find_variable(event, plan)
    if variable.family == "Boolean":
        return 0.5
    if variable.family == "Real":
        return float(from_si(event.level, variable, plan.descriptions[component].unit))
    return float(event.level)


def event_problems(events: Sequence[Event], plan: Plan) -> list[str]:
    """What is wrong with the events, all of it."""
    problems = []
    for event in events:
        if event.direction not in DIRECTIONS:
            problems.append(f"event {event.variable}: direction {event.direction!r} is not known; choose one of "
                            f"{', '.join(DIRECTIONS)}")
        try:
            level_of(event, plan)
        except ValueError as error:
            problems.append(f"event {event.variable}: {error}")
    return problems
