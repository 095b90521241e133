"""The units in which people read a study: those that its file was written in, else those that the FMUs name.

Values stay SI everywhere else. A unit of an outcome follows from its expression where that only chooses, adds or
averages; what was multiplied by numbers has none, and is shown as it was computed.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping

from threadpitch.cosim import Plan
from threadpitch.studies.definition import Study
from threadpitch.studies.errors import StudyError
from threadpitch.studies.expression import CONSTANTS, Expression, name_of
from threadpitch.studies.statistics import STATISTIC_UNITS
from threadpitch.units import UNITS, compatible, unit

Units = Mapping[str, str]  # by parameter and outcome; what is not in it is shown in SI, without a unit
UnitOf = Callable[[str], str | None]  # of a quantity in an expression

ONE = "1"
_NUMBER = ""  # of a number that stands in an expression
_SAME = {"abs", "min", "max", "mean", "std", "sum", "rms", "first", "last", "range", "hypot", "percentile"}


def shown_units(study: Study, plan: Plan | None) -> dict[str, str]:
    """The unit of every parameter and outcome that has one.

    Raises:
        StudyError: a value or limit has a unit that does not fit.
    """
    variables = {} if plan is None else _of_variables(plan)
    found: dict[str, str] = {}
    for parameter in study.parameters:
        chosen = _fitting(parameter.unit, variables.get(parameter.name), f"parameter {parameter.name}")
        if chosen is not None and not isinstance(parameter.middle, str | bool):
            found[parameter.name] = chosen
    known = {**variables, **STATISTIC_UNITS, **found}
    for name, expression in study.outcomes.items():
        chosen = _fitting(study.limit_units.get(name), expression_unit(expression, known.get), f"[limits] {name}")
        if chosen is not None:
            found[name] = chosen
    return found


def expression_unit(expression: Expression, of: UnitOf) -> str | None:
    """The unit that an outcome has; None where it is not known."""
    return _unit(expression.tree, of) or None


def shown(value: float, name: str | None) -> float:
    """A value in SI as it is read in this unit: value / factor - offset / factor."""
    return value if name is None else (value - UNITS[name].offset) / UNITS[name].factor


def shown_width(value: float, name: str | None) -> float:
    """A difference of two values in SI as it is read in this unit: value / factor."""
    return value if name is None else value / UNITS[name].factor


def figures(value: object, name: str | None) -> str:
    """A value in SI as a text of five digits in this unit, without its name; choices and truth values as they are."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return "-" if math.isnan(value) else f"{shown(value, name):.5g}"


def with_unit(value: object, name: str | None) -> str:
    """``3.2 um``; without a unit the number alone."""
    return figures(value, name) + ("" if name in (None, ONE) else f" {name}")


def headed(name: str, units: Units) -> str:
    """A name with its unit, ``lag [mm]``."""
    return name if units.get(name, ONE) == ONE else f"{name} [{units[name]}]"


def _of_variables(plan: Plan) -> dict[str, str]:
    """The units that the FMUs name and the table of units knows, by ``component.variable``."""
    found = {}
    for component, description in plan.descriptions.items():
        for variable in description.variables.values():
            name = variable.display or variable.unit or ONE
            if name in UNITS:
                found[f"{component}.{variable.name}"] = name
        for array, elements in description.arrays.items():
            found[f"{component}.{array}"] = found.get(f"{component}.{elements[0].name}", ONE)
    return found


def _fitting(written: str | None, known: str | None, where: str) -> str | None:
    """The unit that was written, which must measure what the known one does."""
    if written is not None and known is not None and not compatible(unit(written), unit(known)):
        wanted = "no unit" if known == ONE else f"a unit like {known}"
        raise StudyError(f"{where}: {written!r} does not fit; it has {wanted}")
    return written or known


def _unit(node: ast.AST, of: UnitOf) -> str | None:
    name = name_of(node)
    if name is not None:
        return _NUMBER if name in CONSTANTS else of(name)
    match node:
        case ast.Constant() | ast.Compare() | ast.BoolOp():
            return _NUMBER if isinstance(node, ast.Constant) else ONE
        case ast.UnaryOp(op=op, operand=operand):
            return ONE if isinstance(op, ast.Not) else _unit(operand, of)
        case ast.IfExp(body=body, orelse=orelse):
            return _common(_unit(body, of), _unit(orelse, of))
        case ast.BinOp(left=left, op=op, right=right):
            return _joined(op, _unit(left, of), _unit(right, of))
        case ast.Call(func=ast.Name(id=function), args=arguments):
            chosen = arguments[:1] if function == "percentile" else arguments
            if function not in _SAME:
                return ONE
            found = _unit(chosen[0], of)
            for other in chosen[1:]:
                found = _common(found, _unit(other, of))
            return found
    return None


def _joined(op: ast.operator, left: str | None, right: str | None) -> str | None:
    if left is None or right is None:
        return None
    if isinstance(op, ast.Add | ast.Sub | ast.Mod):
        return _common(left, right)
    if left in (ONE, _NUMBER) and right in (ONE, _NUMBER):
        return ONE
    if isinstance(op, ast.Div) and _NUMBER not in (left, right) and compatible(unit(left), unit(right)):
        return ONE
    if isinstance(op, ast.Mult | ast.Div) and right == ONE:
        return left
    return right if isinstance(op, ast.Mult) and left == ONE else None


def _common(left: str | None, right: str | None) -> str | None:
    """The unit of what is added or chosen from two; numbers that stand in an expression are SI."""
    if left is None or right is None:
        return None
    if _NUMBER in (left, right):
        return left or right
    return left if compatible(unit(left), unit(right)) else None
