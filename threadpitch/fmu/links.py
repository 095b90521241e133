"""The checks of what declarations say about each other: dependence, time derivatives, clocks, terminals."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from threadpitch.fmu.declaration import Place
from threadpitch.fmu.variable import Clock, ModelError, Terminal, Variable
from threadpitch.units import BASES, unit

MOST_DERIVATIVES = 2  # FMI 2.0 allows any order; a model takes u' and u''
_SECOND = BASES.index("s")
_Declared = TypeVar("_Declared", Clock, Terminal)
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def check_variables(places: Mapping[str, Place], variables: Sequence[Variable]) -> None:
    """Check what the variables say of each other; ``places`` holds where each is declared.

    Raises:
        ModelError: ``depends_on``, ``derivatives`` or ``derivative`` names a variable that cannot be meant.
    """
    by_name = {variable.name: variable for variable in variables}
    takers: dict[str, str] = {}
    for variable in variables:
        place = places[variable.name]
        _check_depends_on(place, variable, by_name)
        _check_derivatives(place, variable, by_name)
        _check_derivative(place, variable, by_name)
        for name in variable.derivatives:
            if name in takers:
                raise ModelError(place.says(f"derivatives names {name!r}, which takes one of {takers[name]}",
                                            "give each derivative a state of its own"))
            takers[name] = variable.name


def checked_clocks(place: str, clocks: Any, variables: Sequence[Variable]) -> tuple[Clock, ...]:
    """The clocks of the module constant ``CLOCKS``, which stands at ``place`` (``file:line``).

    Raises:
        ModelError: it is not a tuple of ``Clock``, or a clock does not count an int output of the model.
    """
    found = _tuple_of(place, "CLOCKS", Clock, clocks)
    names = {variable.name for variable in variables}
    by_name = {variable.name: variable for variable in variables}
    for clock in found:
        if not _NAME.fullmatch(clock.name) or clock.name in names or clock.name == "time":
            raise ModelError(f"{place}: CLOCKS: the name {clock.name!r} is taken or not legal in FMI; choose another")
        names.add(clock.name)
        counted = by_name.get(clock.ticks)
        if counted is None or counted.kind != "int" or counted.causality != "output":
            raise ModelError(f"{place}: CLOCKS: {clock.name} ticks by {clock.ticks!r}; name an int output")
        if type(clock.element) is not int or not 0 <= clock.element < (counted.size or 1):
            raise ModelError(f"{place}: CLOCKS: {clock.name} ticks by element {clock.element!r} of {clock.ticks}; "
                             f"give one from 0 to {(counted.size or 1) - 1}")
    return found


def checked_terminals(place: str, terminals: Any, variables: Sequence[Variable]) -> tuple[Terminal, ...]:
    """The terminals of the module constant ``TERMINALS``, which stands at ``place`` (``file:line``).

    Raises:
        ModelError: it is not a tuple of ``Terminal``, or a member is not an input or output of the model.
    """
    found = _tuple_of(place, "TERMINALS", Terminal, terminals)
    connected = {variable.name for variable in variables if variable.causality in ("input", "output")}
    names: set[str] = set()
    for terminal in found:
        if not _NAME.fullmatch(terminal.name) or terminal.name in names:
            raise ModelError(f"{place}: TERMINALS: the name {terminal.name!r} is there twice or not legal in FMI; "
                             "choose another")
        names.add(terminal.name)
        if not isinstance(terminal.members, Mapping) or not terminal.members:
            raise ModelError(f"{place}: TERMINALS: {terminal.name} has no members; give {{'member': 'variable'}}")
        for member, name in terminal.members.items():
            if not _NAME.fullmatch(member) or name not in connected:
                raise ModelError(f"{place}: TERMINALS: {terminal.name} has the member {member!r}: {name!r}; "
                                 "name an input or output of the model")
    return found


def _check_depends_on(place: Place, variable: Variable, by_name: Mapping[str, Variable]) -> None:
    inputs = sorted(name for name, other in by_name.items() if other.causality == "input")
    for name in variable.depends_on:
        if name not in inputs:
            raise ModelError(place.says(f"depends_on names {name!r}", f"name inputs: {', '.join(inputs)}"))


def _check_derivatives(place: Place, variable: Variable, by_name: Mapping[str, Variable]) -> None:
    if not variable.derivatives:
        return
    if variable.kind != "float" or variable.size is not None or variable.discrete:
        raise ModelError(place.says("derivatives of what is not a continuous float", "leave derivatives out"))
    if not isinstance(variable.derivatives, tuple) or len(variable.derivatives) > MOST_DERIVATIVES:
        raise ModelError(place.says(f"derivatives={variable.derivatives!r}",
                                    f"give a tuple of at most {MOST_DERIVATIVES} names of states"))
    for order, name in enumerate(variable.derivatives, 1):
        taker = by_name.get(name)
        if taker is None or taker.causality != "local" or not _is_rate(variable, taker, order) or taker.start != 0.0:
            raise ModelError(place.says(f"derivatives names {name!r}",
                                        f"name a float state in the unit of d{order}/dt{order} that starts at 0.0"))


def _check_derivative(place: Place, variable: Variable, by_name: Mapping[str, Variable]) -> None:
    if variable.derivative is None:
        return
    rate = by_name.get(variable.derivative)
    if variable.kind != "float" or variable.size is not None or variable.discrete:
        raise ModelError(place.says("derivative of what is not a continuous float", "leave derivative out"))
    if rate is None or rate.causality not in ("output", "local") or not _is_rate(variable, rate, 1):
        raise ModelError(place.says(f"derivative names {variable.derivative!r}",
                                    "name a float output or state in this variable's unit per second"))


def _is_rate(variable: Variable, rate: Variable, order: int) -> bool:
    """Whether ``rate`` is a scalar float in the unit of the variable's time derivative of this order."""
    if rate.kind != "float" or rate.size is not None:
        return False
    wanted = list(unit(variable.unit).exponents)
    wanted[_SECOND] -= order
    return tuple(wanted) == unit(rate.unit).exponents


def _tuple_of(place: str, name: str, kind: type[_Declared], value: Any) -> tuple[_Declared, ...]:
    if not isinstance(value, Iterable) or isinstance(value, str):
        raise ModelError(f"{place}: {name} must be a tuple of {kind.__name__}")
    found = tuple(value)
    if not all(isinstance(item, kind) for item in found):
        raise ModelError(f"{place}: {name} must be a tuple of {kind.__name__}: {name} = ({kind.__name__}(...),)")
    return found
