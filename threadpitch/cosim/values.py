"""Values that people write for variables: ``40``, ``"10mm"``, ``"true"``, ``"linear_motor"``, ``"0deg, 90deg"``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.system import ParameterValue, Transformation, Value, nearest
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import Unit, UnitError, between, unit

Known: TypeAlias = Callable[[str], Unit]  # finds a unit by its name, or raises UnitError
Given: TypeAlias = Value | Sequence[Value]  # what a caller may hand over for a variable or a whole array

_QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)
_TRUTH = {"true": True, "1": True, "false": False, "0": False}


class VariableValueError(CosimError):
    """A value does not fit its variable; the message does not name the variable, its caller does."""


def parse_value(text: str, variable: FmuVariable, known: Known = unit) -> Value:
    """The value that a text states, in the variable's unit.

    A number without a unit is SI; with a unit (``10mm``, ``500 rpm``) it is converted. A Boolean is ``true``,
    ``false``, 1 or 0, an Enumeration the name or the number of an item.

    Raises:
        VariableValueError: the text is not a value of the variable's type, its unit is unknown or measures another
            quantity, or the value lies outside of the variable's minimum and maximum.
    """
    text = text.strip()
    if variable.family == "String":
        return text
    if variable.family == "Boolean":
        if text.lower() not in _TRUTH:
            raise VariableValueError(f"{text!r} is not a Boolean; write true or false")
        return _TRUTH[text.lower()]
    if variable.choices and text in variable.choices:
        return variable.choices[text]
    match = _QUANTITY.fullmatch(text)
    if match is None:
        if variable.choices:
            raise VariableValueError(f"{text!r} is not a choice{nearest(text, variable.choices)}")
        example = "10 or 10mm" if variable.family == "Real" else "10"
        raise VariableValueError(f"{text!r} is not a number; write it like {example}")
    number, written = match.groups()
    if variable.family == "Real":
        return _in_range(_from_unit(float(number), written or None, variable, known), variable)
    if written:
        raise VariableValueError(f"{text!r} has a unit, but the variable is a plain {variable.type}; write {number}")
    # A float would round whole numbers of more than 53 bits.
    return from_si(int(number) if number.lstrip("+-").isdecimal() else float(number), variable, known)


def from_si(value: object, variable: FmuVariable, known: Known = unit) -> Value:
    """The value in the variable's unit, of a number in SI, a truth value or a text (see ``parse_value``).

    NumPy's scalars are taken as well.

    Raises:
        VariableValueError: as ``parse_value``, or the Python type does not fit the variable's type.
    """
    if isinstance(value, str):
        return parse_value(value, variable, known)
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool):
        if variable.family != "Boolean":
            raise VariableValueError(f"{value} is a truth value, but the variable is {variable.type}")
        return value
    if not isinstance(value, int | float):
        raise VariableValueError(f"{value!r} is not a number, truth value or text")
    match variable.family:
        case "Boolean" if value in (0, 1):
            return bool(value)
        case "Integer" | "Enumeration":
            return _in_range(_whole(value, variable), variable)
        case "Real":
            try:
                number = float(value)
            except OverflowError:
                raise VariableValueError("a whole number of this size does not fit into a Real") from None
            return _in_range(_from_unit(number, None, variable, known), variable)
        case _:
            raise VariableValueError(f"{value!r} is a number, but the variable is {variable.type}")


def from_parameter_set(value: ParameterValue, variable: FmuVariable, known: Known = unit) -> Value:
    """The value in the variable's unit, of an entry of an SSV: in the unit it states, else in the variable's own.

    The linear transformation of a parameter mapping comes after the conversion of units (SSP 1.0, 5.5.1).

    Raises:
        VariableValueError: as ``from_si``.
    """
    given = value.value
    if variable.family != "Real" or isinstance(given, bool | str):
        if isinstance(given, str) and variable.family not in ("String", "Enumeration"):
            raise VariableValueError(f"{given!r} is a text, but the variable is {variable.type}")
        return from_si(given, variable, known)
    number, way = float(given), value.transformation or Transformation()
    if value.unit is not None and way.convert_units:
        definition = value.definition
        lookup: Known = known if definition is None else lambda name: definition if name == value.unit else known(name)
        number = _from_unit(number, value.unit, variable, lookup)
    return _in_range(number if way == Transformation() else way.factor * number + way.offset, variable)


def _from_unit(number: float, written: str | None, variable: FmuVariable, known: Known) -> float:
    """``factor * number + offset``: a number in a written unit (None: SI) in the variable's unit."""
    if written is not None and written == variable.unit:
        return number
    if not variable.unit:
        if written is not None:
            raise VariableValueError(f"{number:g} {written}: the variable has no unit; write the number alone")
        return number
    try:
        own = known(variable.unit)
    except UnitError:
        if written is None:
            return number  # nobody knows its unit: the number can only be meant in it
        raise VariableValueError(f"{number:g} {written}: unit {variable.unit!r} of the variable is not known; "
                           "write the number in it, without a unit") from None
    try:
        source = Unit("SI", own.exponents) if written is None else known(written)
        factor, offset = between(source, own)
    except UnitError as error:
        raise VariableValueError(f"{number:g} {written}: {error}") from None
    return number if (factor, offset) == (1.0, 0.0) else factor * number + offset


def _whole(value: float, variable: FmuVariable) -> int:
    if isinstance(value, float) and not value.is_integer():
        raise VariableValueError(f"{value} is not a whole number")
    number, bounds = int(value), np.iinfo(C_TYPES[variable.c_type].dtype)
    if not bounds.min <= number <= bounds.max:
        sign = "" if bounds.min else " without sign"
        raise VariableValueError(f"{number} does not fit into {bounds.bits} bits{sign}")
    return number


def _in_range(value: float, variable: FmuVariable) -> float:
    """The value itself, when it is finite and within the variable's bounds (and, of an Enumeration, an item)."""
    name = f" {variable.unit}" if variable.unit not in (None, "1") else ""
    if not math.isfinite(value):
        raise VariableValueError(f"{value} is not a finite number")
    if variable.minimum is not None and value < variable.minimum:
        raise VariableValueError(f"{value:g}{name} is below the minimum of {variable.minimum:g}{name}")
    if variable.maximum is not None and value > variable.maximum:
        raise VariableValueError(f"{value:g}{name} is above the maximum of {variable.maximum:g}{name}")
    if variable.choices and value not in variable.choices.values():
        items = ", ".join(f"{item} ({number})" for item, number in variable.choices.items())
        raise VariableValueError(f"{value} is not a choice; known are {items}")
    return value
