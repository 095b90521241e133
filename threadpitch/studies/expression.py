"""Expressions of a study's outcomes: Python's arithmetic over named quantities, and nothing else of Python.

    max(abs(z_drive.following_error)) / controller.lead

Names are ``component.variable`` with the indices of arrays, statistics of the pitches, and parameters of the row. A
text is parsed, never executed: only what stands in the tables below is computed. (Libraries for safe evaluation take
dots for attributes and brackets for subscripts of Python objects; here both belong to the name.)
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeAlias

import numpy as np

from threadpitch.cosim.system import nearest
from threadpitch.studies.errors import StudyError

Quantity: TypeAlias = Any  # a number, a truth value, a text, or an array (rows,) of numbers

LONGEST = 2000  # characters

_BINARY: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.divide, ast.Pow: np.power,
    ast.Mod: np.mod}
_UNARY: Mapping[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: np.logical_not}
_COMPARED: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Eq: operator.eq,
    ast.NotEq: operator.ne}


def _extreme(of_all: Callable[[Any], Any], of_two: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    """``max(a)`` over an array, ``max(a, b, ...)`` element by element."""
    def chosen(first: Any, *others: Any) -> Any:
        found = first
        for other in others:
            found = of_two(found, other)
        return found if others else of_all(first)
    return chosen


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "abs": np.abs, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos, "tan": np.tan,
    "hypot": np.hypot, "min": _extreme(np.min, np.minimum), "max": _extreme(np.max, np.maximum), "mean": np.mean,
    "std": np.std, "sum": np.sum, "rms": lambda values: np.sqrt(np.mean(np.square(values))), "any": np.any,
    "all": np.all, "first": lambda values: np.ravel(values)[0], "last": lambda values: np.ravel(values)[-1],
    "range": np.ptp, "percentile": np.percentile,
}
_MANY = 100
_ARGUMENTS: Mapping[str, tuple[int, int]] = {  # least and most values of a function; of all others one
    "hypot": (2, 2), "percentile": (2, 2), "min": (1, _MANY), "max": (1, _MANY)}
CONSTANTS: Mapping[str, Any] = {"pi": math.pi, "true": True, "false": False}


class Expression:
    """A parsed text, ``tree``; ``names`` are the quantities that it needs.

    Raises (the class itself):
        StudyError: it is no such expression.
    """

    def __init__(self, text: str, where: str) -> None:
        self.text = text
        self._where = where
        if len(text) > LONGEST:
            raise self._error(f"is longer than {LONGEST} characters")
        try:
            self.tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._error("is no expression; write it like max(abs(z_drive.following_error))") from None
        try:
            self.names = frozenset(self._look(self.tree))
        except RecursionError:
            raise self._error("is nested too deeply; write it as several outcomes") from None

    def __call__(self, quantity: Callable[[str], Quantity]) -> float | bool | str:
        """The value: one number, truth value or text.

        Raises:
            StudyError: it is an array, or cannot be computed.
        """
        try:
            with np.errstate(all="ignore"):  # what is not finite stays so, and is told by the row
                found = self._value(self.tree, quantity)
        except StudyError as error:  # of a quantity, in words of its own
            raise StudyError(f"{self._where}: {error}") from None
        except (TypeError, ValueError, ZeroDivisionError, OverflowError) as error:
            raise self._error(f"cannot be computed: {' '.join(str(error).split())}") from None
        if isinstance(found, str):
            return found
        if np.ndim(found) != 0:
            raise self._error(f"gives {np.size(found)} values; take one of them, such as max(...) or last(...)")
        return bool(found) if isinstance(found, bool | np.bool_) else float(found)

    def _look(self, node: ast.AST) -> Iterator[str]:
        """The names in a tree that holds only what is known."""
        name = name_of(node)
        if name is not None:
            if name in FUNCTIONS:
                raise self._error(f"names the function {name} without (...)")
            if name not in CONSTANTS:
                yield name
            return
        match node:
            case ast.Constant(value=value) if isinstance(value, int | float | str):
                return
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                parts: list[ast.expr] = [left, right]
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                parts = [operand]
            case ast.BoolOp(values=values):
                parts = values
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _COMPARED for op in ops):
                parts = [left, *others]
            case ast.IfExp(test=test, body=body, orelse=orelse):
                parts = [test, body, orelse]
            case ast.Call(func=ast.Name(id=function), args=arguments, keywords=[]):
                if function not in FUNCTIONS:
                    raise self._error(f"has no function {function!r}{nearest(function, FUNCTIONS)}")
                least, most = _ARGUMENTS.get(function, (1, 1))
                if not least <= len(arguments) <= most:
                    raise self._error(f"gives {function} {len(arguments)} values; it takes {_said(least, most)}")
                parts = arguments
            case _:
                raise self._error(f"holds {ast.unparse(node)!r}, which is not arithmetic")
        for part in parts:
            yield from self._look(part)

    def _value(self, node: ast.AST, quantity: Callable[[str], Quantity]) -> Quantity:
        name = name_of(node)
        if name is not None:
            return CONSTANTS[name] if name in CONSTANTS else quantity(name)
        match node:
            case ast.Constant(value=value):
                return value if isinstance(value, str | bool) else float(value)  # type: ignore[arg-type] # _look saw it
            case ast.BinOp(left=left, op=op, right=right):
                return _BINARY[type(op)](self._value(left, quantity), self._value(right, quantity))
            case ast.UnaryOp(op=op, operand=operand):
                return _UNARY[type(op)](self._value(operand, quantity))
            case ast.BoolOp(op=op, values=values):
                join = np.logical_and if isinstance(op, ast.And) else np.logical_or
                return join.reduce([self._value(one, quantity) for one in values])
            case ast.Compare(left=left, ops=ops, comparators=others):
                chain = [self._value(one, quantity) for one in (left, *others)]
                return np.logical_and.reduce([_COMPARED[type(op)](one, other) for op, one, other
                                              in zip(ops, chain, chain[1:], strict=False)])
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self._value(body if self._value(test, quantity) else orelse, quantity)
            case ast.Call(func=ast.Name(id=function), args=arguments):
                return FUNCTIONS[function](*(self._value(one, quantity) for one in arguments))
        raise self._error("cannot be computed")

    def _error(self, what: str) -> StudyError:
        return StudyError(f"{self._where}: {self.text[:80]!r} {what}")


def _said(least: int, most: int) -> str:
    return str(least) if least == most else f"{least} or more"


def name_of(node: ast.AST) -> str | None:
    """``a.b[1]`` as one name; None for what is none."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=owner, attr=word):
            before = name_of(owner)
            return None if before is None else f"{before}.{word}"
        case ast.Subscript(value=owner, slice=index):
            before = name_of(owner)
            numbers = index.elts if isinstance(index, ast.Tuple) else [index]
            if before is None or not all(isinstance(one, ast.Constant) and type(one.value) is int
                                         for one in numbers):
                return None
            return f"{before}[{','.join(ast.unparse(one) for one in numbers)}]"
    return None
