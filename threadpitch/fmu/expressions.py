"""The types of expressions in the subset of Python that every flavour can be built from.

What runs in Python and is translated to C must mean the same there. Python's ``x**2``, ``%`` and ``//`` of floats,
mixed ``min`` and calls that change the model amid other operands do not; they are refused here, each with what to write
instead.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NoReturn

from threadpitch.fmu.source_text import SourceText
from threadpitch.fmu.variable import ModelError

NUMBERS = ("int", "float")
SCALARS = ("int", "float", "bool")


@dataclass(frozen=True)
class Signature:
    """Types of the arguments and of the result ("none" for nothing, "tuple[float,int]" for several)."""

    arguments: tuple[str, ...]
    result: str


MATHEMATICS = {"floor": Signature(("float",), "int"), "sqrt": Signature(("float",), "float")}
CONSTANTS = {"pi": "float"}


@dataclass(frozen=True)
class Names:
    """What every function of a module can see."""

    text: SourceText
    constants: Mapping[str, str]  # name -> type
    functions: Mapping[str, Signature]
    fields: Mapping[str, str] = field(default_factory=dict)  # of self; arrays are "list[float]" and so on
    methods: Mapping[str, Signature] = field(default_factory=dict)
    changing: frozenset[str] = frozenset()  # methods that change a field, themselves or through others
    sizes: Mapping[str, int] = field(default_factory=dict)  # of the fields that are arrays


def refuse(text: SourceText, node: ast.AST, construct: str, mend: str) -> NoReturn:
    """Raise the one-line message: file, line, construct, mend."""
    raise ModelError(f"{text.place(getattr(node, 'lineno', 1))}: {construct} cannot be in an FMU; {mend}")


def with_article(kind: str) -> str:
    """The name of a type with its article."""
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


class Typing:
    """Types of expressions within one function; ``known`` holds its arguments and the locals assigned so far."""

    def __init__(self, names: Names, known: dict[str, str]) -> None:
        self.names = names
        self.known = known

    def refuse(self, node: ast.AST, construct: str, mend: str) -> NoReturn:
        """Raise ``ModelError`` for a construct of this file."""
        refuse(self.names.text, node, construct, mend)

    def of(self, node: ast.expr) -> str:
        """The type of an expression.

        Raises:
            ModelError: it, or a part of it, is outside the subset.
        """
        match node:
            case ast.Constant():
                return self._constant(node)
            case ast.Name():
                return self._name(node)
            case ast.Attribute():
                return self._field(node)
            case ast.Subscript():
                return self._element(node)
            case ast.BinOp():
                return self.binary(node, node.op, (self.of(node.left), self.of(node.right)))
            case ast.UnaryOp():
                return self._unary(node)
            case ast.BoolOp():
                for value in node.values:
                    self.wanted(value, "bool", "an operand of and/or")
                return "bool"
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                return self._choice(node)
            case ast.Call():
                return self._call(node)
        return self.refuse(node, f"{ast.unparse(node)} ({type(node).__name__})",
                           "use numbers, fields, arrays by index, arithmetic and calls")

    def wanted(self, node: ast.expr, kind: str, what: str) -> None:
        """Refuse an expression that is not of this type."""
        found = self.of(node)
        if found != kind:
            hints = {("int", "float"): f"write float({ast.unparse(node)}), or a literal with a decimal point",
                     ("float", "int"): "write floor(...), or make the target a float"}
            self.refuse(node, f"{what} of type {found} ({ast.unparse(node)}) where {kind} is needed",
                        hints.get((found, kind), f"give {with_article(kind)}"))

    def _constant(self, node: ast.Constant) -> str:
        value = node.value
        if isinstance(value, bool):
            return "bool"
        if isinstance(value, int):
            if abs(value) >= 2**63:
                self.refuse(node, f"the number {value}", "keep an int within 64 bits, or write it as a float")
            return "int"
        if isinstance(value, float) and math.isfinite(value):
            return "float"
        return self.refuse(node, f"the constant {value!r}", "use finite numbers and True or False")

    def _name(self, node: ast.Name) -> str:
        if node.id in self.known:
            return self.known[node.id]
        if node.id in self.names.constants:
            return self.names.constants[node.id]
        return self.refuse(node, f"{node.id}, which has no value on every way to this line",
                           "assign it before any branch or loop, or define it as a number at the top of the file")

    def _field(self, node: ast.Attribute) -> str:
        if isinstance(node.value, ast.Name) and node.value.id == "self":
            if node.attr in self.names.fields:
                return self.names.fields[node.attr]
            self.refuse(node, f"self.{node.attr}, which is not declared", "declare it as a field: state(...)")
        return self.refuse(node, ast.unparse(node), "import names from math: from math import floor, sqrt, pi")

    def _element(self, node: ast.Subscript) -> str:
        array = self.of(node.value)
        if not array.startswith("list["):
            self.refuse(node, f"an index into {ast.unparse(node.value)} of type {array}", "index arrays only")
        index = node.slice
        if isinstance(index, ast.Slice):
            self.refuse(node, f"the slice {ast.unparse(node)}", "write a loop over the index")
        if isinstance(index, ast.UnaryOp) and isinstance(index.op, ast.USub):
            self.refuse(node, f"the negative index {ast.unparse(node)}", "count from the front")
        self.wanted(index, "int", "an index")
        size = self.names.sizes.get(node.value.attr) if isinstance(node.value, ast.Attribute) else None
        if size is not None and isinstance(index, ast.Constant) \
                and isinstance(index.value, int) and index.value >= size:
            self.refuse(node, f"the index {ast.unparse(node)} outside its {size} values",
                        f"count from 0 to {size - 1}, or declare a larger size=")
        return array[len("list["):-1]

    def binary(self, node: ast.AST, operator: ast.operator, kinds: tuple[str, str]) -> str:
        """The type of ``a operator b``."""
        if not all(kind in NUMBERS for kind in kinds):
            self.refuse(node, f"arithmetic with {' and '.join(kinds)}", "use numbers; for a bool write an if")
        match operator:
            case ast.Add() | ast.Sub() | ast.Mult():
                return "float" if "float" in kinds else "int"
            case ast.Div():
                return "float"
            case ast.Mod() | ast.FloorDiv() if kinds == ("int", "int"):
                return "int"
            case ast.Mod():
                self.refuse(node, "% of floats, whose zero has another sign in C,", "write x - y * floor(x / y)")
            case ast.FloorDiv():
                self.refuse(node, "// of floats, which rounds differently in C,", "write floor(x / y)")
            case ast.Pow():
                self.refuse(node, "**, which rounds differently in C,", "multiply, or use sqrt, exp and log")
        return self.refuse(node, f"the operator {type(operator).__name__}", "use + - * /, and // and % of ints")

    def _unary(self, node: ast.UnaryOp) -> str:
        kind = self.of(node.operand)
        if isinstance(node.op, ast.Not):
            if kind != "bool":
                self.refuse(node, f"not of type {kind}", "compare: x == 0.0")
            return "bool"
        if kind not in NUMBERS or isinstance(node.op, ast.Invert):
            self.refuse(node, ast.unparse(node), "use - and + of numbers")
        return kind

    def _compare(self, node: ast.Compare) -> str:
        kinds = [self.of(value) for value in (node.left, *node.comparators)]
        for operator in node.ops:
            if not isinstance(operator, ast.Eq | ast.NotEq | ast.Lt | ast.LtE | ast.Gt | ast.GtE):
                self.refuse(node, f"the comparison {ast.unparse(node)}", "use == != < <= > >=")
        if all(kind in NUMBERS for kind in kinds):
            return "bool"
        if set(kinds) == {"bool"} and len(kinds) == 2 and isinstance(node.ops[0], ast.Eq | ast.NotEq):
            return "bool"
        return self.refuse(node, f"the comparison of {' with '.join(kinds)}", "compare numbers, or == of two bools")

    def _choice(self, node: ast.IfExp) -> str:
        self.wanted(node.test, "bool", "a condition")
        kind = self.of(node.body)
        if kind not in SCALARS:
            self.refuse(node, f"a choice between values of type {kind}", "write an if")
        self.wanted(node.orelse, kind, "the other choice")
        return kind

    def _call(self, node: ast.Call) -> str:
        text = ast.unparse(node.func)
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            self.refuse(node, f"a call of {text} with keywords or *", "give the arguments by position")
        if text in ("abs", "min", "max", "float", "int"):
            return self._builtin(node, text)
        if isinstance(node.func, ast.Attribute) and text.startswith("self."):
            signature = self.names.methods.get(node.func.attr)
        else:
            signature = self.names.functions.get(text)
        if signature is None:
            self.refuse(node, f"a call of {text}", "call what this file defines, floor, sqrt, abs, min, max, float, "
                                                   "int, or sin, cos, exp, log of threadpitch.fmu.elementary")
        if len(node.args) != len(signature.arguments):
            self.refuse(node, f"a call of {text} with {len(node.args)} arguments", f"give {len(signature.arguments)}")
        for argument, kind in zip(node.args, signature.arguments, strict=True):
            self.wanted(argument, kind, f"an argument of {text}")
        return signature.result

    def _builtin(self, node: ast.Call, name: str) -> str:
        kinds = [self.of(argument) for argument in node.args]
        if not kinds or any(kind not in NUMBERS for kind in kinds):
            self.refuse(node, f"{name} of {', '.join(kinds) or 'nothing'}", "give numbers")
        if name in ("min", "max"):
            if len(kinds) < 2 or len(set(kinds)) != 1:
                self.refuse(node, f"{name} of {', '.join(kinds)}", "give two or more numbers of one type")
        elif len(kinds) != 1:
            self.refuse(node, f"{name} of {len(kinds)} arguments", "give one")
        return name if name in ("float", "int") else kinds[0]


def check_order(names: Names, node: ast.AST, expressions: list[ast.expr]) -> None:
    """Refuse a method that changes fields amid other reads of fields: C does not say which comes first.

    Raises:
        ModelError: such a call stands beside another read of ``self``, or beside a second such call.
    """
    calls = [item for expression in expressions for item in ast.walk(expression)
             if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute)
             and item.func.attr in names.changing]
    if not calls:
        return
    inside = {id(item) for item in ast.walk(calls[0])}
    others = [item for expression in expressions for item in ast.walk(expression)
              if isinstance(item, ast.Attribute) and id(item) not in inside]
    nested = [item for argument in calls[0].args for item in ast.walk(argument) if item in calls]
    if others or nested or len(calls) > 1:
        refuse(names.text, node, f"{ast.unparse(calls[0].func)}(...), which changes fields, amid other reads of fields",
               "call it alone first and keep its result in a local")
