"""What a connection does to the values: units and transformations, from variable to variable, as one law."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.system import Connection, Connector, Table, Transformation, nearest
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import Unit, between

Known: TypeAlias = Callable[[str], Unit]  # finds a unit by its name, or raises UnitError
Pairs: TypeAlias = tuple[tuple[int, int], ...]  # of values; what is not in it stays
_TRUTH = {"true": 1, "1": 1, "false": 0, "0": 0}


class ConversionError(CosimError):
    """A transformation does not suit the values; the message does not name the connection, its caller does."""


@dataclass(frozen=True)
class Law:
    """``target = factor * source + offset`` of reals, a table of all others."""

    factor: float = 1.0
    offset: float = 0.0
    table: Pairs = ()


@dataclass(frozen=True)
class Stage:
    """A place on the way of the values: their unit there, where it is looked up, and the items of an enumeration."""

    unit: str | None
    known: Known
    choices: Mapping[str, int] | None = None

    @classmethod
    def of(cls, connector: Connector | None, otherwise: Stage, units: Mapping[str, Unit]) -> Stage:
        """At a connector; what it does not state is as ``otherwise``. ``units`` are those that the system defines."""
        def known(name: str) -> Unit:
            if connector is not None and connector.definition is not None and name == connector.unit:
                return connector.definition
            return units[name] if name in units else otherwise.known(name)

        if connector is None:
            return cls(otherwise.unit, known, otherwise.choices)
        return cls(connector.unit or otherwise.unit, known, connector.choices or otherwise.choices)


def stages(connection: Connection, first: Stage, last: Stage, units: Mapping[str, Unit]) -> list[Stage]:
    """Where the values pass, from the connector at the start (``first``) to that at the end."""
    passed = [first]
    for passage in connection.through:
        passed.append(Stage.of(passage.connector, passed[-1], units))
    return [*passed, last]


def law(connection: Connection, passed: Sequence[Stage], variable: FmuVariable) -> Law:
    """What becomes of values of the variable's type between the first and the last stage.

    Raises:
        UnitError: a unit is not known, or two measure different quantities.
        ConversionError: a transformation is not one for values of this type.
    """
    ways = [connection.transformation, *(passage.transformation for passage in connection.through)]
    found = Law()
    for way, one, other in zip(ways, passed, passed[1:], strict=False):
        if variable.family == "Real":
            _refuse_table(way)
            found = _after(found, between_units(one, other) if way.convert_units else Law())
            if not (math.isfinite(way.factor) and math.isfinite(way.offset)):
                raise ConversionError(f"the LinearTransformation {way.factor:g} x + {way.offset:g} is not finite")
            found = _after(found, Law(way.factor, way.offset))
        else:
            found = Law(table=_then(found.table, _pairs(way, one, other, variable)))
    return found


def between_units(one: Stage, other: Stage) -> Law:
    """The conversion of units; equal names and missing units convert to themselves.

    Raises:
        UnitError: a unit is not known, or the two measure different quantities.
    """
    if one.unit == other.unit or not one.unit or not other.unit:
        return Law()
    return Law(*between(one.known(one.unit), other.known(other.unit)))


def joined(laws: Sequence[Law]) -> Law:
    """The laws one after another."""
    found = Law()
    for one in laws:
        found = Law(*_linear(found, one), _then(found.table, one.table))
    return found


def looked_up(table: Table, value: int | bool | str, choices: Mapping[str, int] | None) -> int | bool | str:
    """The value that a table gives for one; that value itself where the table does not name it.

    ``choices`` are the items of the value's enumeration, which tell the number of an item, and the item of a number.
    """
    if table.kind == "Enumeration":
        names = {number: name for name, number in (choices or {}).items()}
        key = value if isinstance(value, str) else names.get(value, "")
        return dict(table.entries).get(key, value)
    number = (choices or {}).get(value) if isinstance(value, str) else int(value)
    read = _TRUTH.__getitem__ if table.kind == "Boolean" else int
    for source, target in table.entries:
        if number is not None and read(source) == number:
            return bool(read(target)) if table.kind == "Boolean" else read(target)
    return value


def _refuse_table(way: Transformation) -> None:
    if way.table is not None:
        raise ConversionError(f"a mapping of {way.table.kind} values serves no Real variables")


def _pairs(way: Transformation, one: Stage, other: Stage, variable: FmuVariable) -> Pairs:
    if (way.factor, way.offset) != (1.0, 0.0):
        raise ConversionError(f"a linear transformation serves Real variables, not {variable.type}")
    if way.table is None:
        return ()
    if (way.table.kind == "Boolean") != (variable.family == "Boolean"):
        raise ConversionError(f"a mapping of {way.table.kind} values serves no {variable.type} variables")
    if way.table.kind == "Boolean":
        return tuple((_TRUTH[source], _TRUTH[target]) for source, target in way.table.entries)
    if way.table.kind == "Integer":
        return tuple((int(source), int(target)) for source, target in way.table.entries)
    return tuple((_item(source, one), _item(target, other)) for source, target in way.table.entries)


def _item(name: str, stage: Stage) -> int:
    choices = stage.choices or {}
    if name not in choices:
        raise ConversionError(f"the mapping names {name!r}, no item of the enumeration{nearest(name, choices)}")
    return choices[name]


def _then(first: Pairs, second: Pairs) -> Pairs:
    """The second table applied to what the first gives; pairs that change nothing are left out."""
    one, other = dict(first), dict(second)
    both = {source: other.get(target, target) for source, target in one.items()}
    both = {source: target for source, target in other.items() if source not in one} | both
    return tuple(sorted((source, target) for source, target in both.items() if source != target))


def _linear(first: Law, second: Law) -> tuple[float, float]:
    return second.factor * first.factor, second.factor * first.offset + second.offset


def _after(first: Law, second: Law) -> Law:
    return Law(*_linear(first, second))
