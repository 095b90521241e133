"""The checks of one declared variable: type, name, unit, start value and range."""

from __future__ import annotations

import keyword
import math
import re
from dataclasses import dataclass, replace

from threadpitch.fmu.variable import ModelError, Variable
from threadpitch.units import UnitError, compatible, unit

KINDS = {"float": float, "int": int, "bool": bool}
INTEGER_LEAST, INTEGER_GREATEST = -(2**31), 2**31 - 1  # fmi2Integer and FMI 3 Int32
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
# Members of the translated C struct have these names too; time is the independent variable of FMI 3.
_RESERVED = """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool complex
    imaginary true false time near far errno stdin stdout stderr assert offsetof is_freed linux unix
"""
_C_WORDS = frozenset(_RESERVED.split())


@dataclass(frozen=True)
class Place:
    """Where a declaration stands: ``file:line`` and the variable."""

    line: str
    name: str

    def says(self, what: str, mend: str) -> str:
        """The one-line message."""
        return f"{self.line}: {self.name}: {what}; {mend}"


def checked_variable(place: Place, annotation: str, declared: Variable) -> Variable:
    """The declared variable with its name and kind filled in.

    Raises:
        ModelError: name, type, unit, start value, range or choices do not make sense.
    """
    _check_name(place)
    kind = _kind(place, annotation, declared)
    variable = replace(declared, name=place.name, kind=kind)
    _check_unit(place, variable)
    _check_type(place, variable)
    _check_range(place, variable)
    _check_choices(place, variable)
    if not variable.description.strip() or "\n" in variable.description:
        raise ModelError(place.says("the description is empty or has several lines", "write one line"))
    return variable


def _check_name(place: Place) -> None:
    name = place.name
    if not _NAME.fullmatch(name):
        raise ModelError(place.says("this name is not legal in FMI", "use letters, digits and _, a letter first"))
    if name in _C_WORDS or keyword.iskeyword(name) or name.endswith("__") or (name.isupper() and len(name) > 1):
        raise ModelError(place.says("this name has a meaning in C", "choose another, in lower case"))


def _kind(place: Place, annotation: str, declared: Variable) -> str:
    scalar = annotation.removeprefix("list[").removesuffix("]") if annotation.startswith("list[") else annotation
    if scalar not in KINDS:
        raise ModelError(place.says(f"type {annotation} cannot be in an FMU", "use float, int, bool or a list of them"))
    if (scalar != annotation) != (declared.size is not None):
        raise ModelError(place.says(f"type {annotation} and size={declared.size} do not fit",
                                    "list[...] with size=n, a scalar without size"))
    if declared.size is not None and (type(declared.size) is not int or declared.size < 1):
        raise ModelError(place.says(f"size={declared.size!r} is not a size", "give an int of 1 or more"))
    return scalar


def _check_unit(place: Place, variable: Variable) -> None:
    try:
        known = unit(variable.unit)
        shown = unit(variable.display) if variable.display is not None else known
    except UnitError as error:
        raise ModelError(f"{place.line}: {place.name}: {error}") from error
    if known.factor != 1.0 or known.offset != 0.0:
        raise ModelError(place.says(f"{variable.unit!r} is not an SI unit", "declare SI, put this one into display="))
    if not compatible(known, shown):
        raise ModelError(place.says(f"display unit {variable.display!r} measures another quantity than "
                                    f"{variable.unit!r}", "choose one of the same quantity"))
    if variable.kind != "float" and (variable.unit != "1" or variable.display is not None):
        raise ModelError(place.says(f"FMI gives no unit to {variable.kind}", 'declare the unit "1" without display'))


def _check_type(place: Place, variable: Variable) -> None:
    wanted = KINDS[variable.kind]
    if type(variable.start) is not wanted:
        example = {"float": "1.0", "int": "0", "bool": "False"}[variable.kind]
        raise ModelError(place.says(f"is {variable.kind} but starts at {variable.start!r}",
                                    f"write start={example} or another {variable.kind}"))
    if not math.isfinite(variable.start):
        raise ModelError(place.says(f"starts at {variable.start}", "give a finite start value"))
    limits = (variable.min, variable.max)
    if variable.kind == "bool" and limits != (None, None):
        raise ModelError(place.says("is bool and has no range", "leave min and max out"))
    if variable.kind == "int":
        if not all(type(limit) is int and INTEGER_LEAST <= limit <= INTEGER_GREATEST for limit in limits):
            raise ModelError(place.says("an int declares its bounds within 32 bits",
                                        "give min= and max= as int, or make it float"))
    elif any(limit is not None and not math.isfinite(limit) for limit in limits):
        raise ModelError(place.says("min or max is not finite", "leave it out"))
    nominal = variable.nominal
    if nominal is not None and not (variable.kind == "float" and 0.0 < nominal < math.inf):
        raise ModelError(place.says(f"nominal={nominal}", "give a positive magnitude, for float only"))


def _check_range(place: Place, variable: Variable) -> None:
    least = -math.inf if variable.min is None else variable.min
    greatest = math.inf if variable.max is None else variable.max
    if not least <= variable.start <= greatest:
        raise ModelError(place.says(f"start {variable.start} is outside {least} to {greatest}",
                                    "mend start, min or max"))


def _check_choices(place: Place, variable: Variable) -> None:
    if variable.choices is None:
        return
    if variable.kind != "int" or variable.start not in variable.choices.values():
        raise ModelError(place.says("choices are for an int that starts at one of them", "mend type or start"))
    if len(set(variable.choices.values())) != len(variable.choices):
        raise ModelError(place.says("two choices have the same number", "number them differently"))
