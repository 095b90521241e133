"""The statements of the subset: assignments, if, while, for over a range, return.

A local has one type in its function and a value on every way to where it is read; C would read whatever memory holds.
"""

from __future__ import annotations

import ast
from typing import NoReturn

from threadpitch.fmu.c_names import check_local
from threadpitch.fmu.expressions import SCALARS, Names, Typing, check_order, refuse, with_article

_MENDS = {
    "Try": "test before, and return a declared error", "Raise": "return a declared error number",
    "Assert": "return a declared error number", "With": "leave it out", "Match": "write if and elif",
    "FunctionDef": "write a function of the file", "ClassDef": "keep one class per file", "Lambda": "write a function",
    "Global": "make it a field", "Nonlocal": "make it a field", "Delete": "leave it out",
    "Import": "import at the top of the file", "ImportFrom": "import at the top of the file",
}


def check_function(names: Names, node: ast.FunctionDef, writable: frozenset[str]) -> None:
    """Refuse a function or method that leaves the subset; ``writable`` are the fields that it may assign.

    Raises:
        ModelError: the first construct outside the subset.
    """
    method = bool(node.args.args) and node.args.args[0].arg == "self"
    signature = names.methods[node.name] if method else names.functions[node.name]
    arguments = [argument.arg for argument in (node.args.args[1:] if method else node.args.args)]
    for argument in node.args.args:
        check_local(names.text, argument, argument.arg)
    body = node.body[1:] if ast.get_docstring(node) is not None else node.body
    checker = _Checker(names, dict(zip(arguments, signature.arguments, strict=True)), signature.result, writable)
    ended = checker.block(body)
    if signature.result != "none" and not ended:
        refuse(names.text, node, f"{node.name}, which can end without a value,", "end it with a return")


class _Checker:
    """One function: the locals known so far, and the types they had anywhere in it."""

    def __init__(self, names: Names, known: dict[str, str], result: str, writable: frozenset[str]) -> None:
        self.names = names
        self.typing = Typing(names, known)
        self.types = dict(known)
        self.result = result
        self.writable = writable
        self.loop_names: list[str] = []

    def refuse(self, node: ast.AST, construct: str, mend: str) -> NoReturn:
        refuse(self.names.text, node, construct, mend)

    def block(self, body: list[ast.stmt]) -> bool:
        """Check the statements in order; whether every way through them ends in return, break or continue."""
        ended = False
        for node in body:
            if ended:
                self.refuse(node, "a statement that is never reached", "take it out")
            ended = self.statement(node)
        return ended

    def statement(self, node: ast.stmt) -> bool:
        """Check one statement; whether the next one is never reached."""
        match node:
            case ast.Assign():
                self._assign(node)
            case ast.AnnAssign():
                self._annotated(node)
            case ast.AugAssign():
                self._augmented(node)
            case ast.If():
                return self._if(node)
            case ast.While():
                self._while(node)
            case ast.For():
                self._for(node)
            case ast.Return():
                self._return(node)
                return True
            case ast.Break() | ast.Continue():
                return True
            case ast.Expr(value=ast.Call() as call):
                self.typing.of(call)
                check_order(self.names, node, [call])
            case ast.Pass():
                pass
            case _:
                kind = type(node).__name__
                self.refuse(node, f"{kind} ({ast.unparse(node).splitlines()[0]})",
                            _MENDS.get(kind, "use assignments, if, while, for over range, and return"))
        return False

    def _assign(self, node: ast.Assign) -> None:
        if len(node.targets) != 1:
            self.refuse(node, f"the chained assignment {ast.unparse(node)}", "assign one after the other")
        target = node.targets[0]
        if isinstance(target, ast.Tuple):
            self._assign_tuple(node, target)
            return
        kind = self.typing.of(node.value)
        check_order(self.names, node, [node.value, *_index_of(target)])
        self._store(target, kind, node.value)

    def _assign_tuple(self, node: ast.Assign, target: ast.Tuple) -> None:
        if not isinstance(node.value, ast.Call):
            self.refuse(node, f"the assignment {ast.unparse(node)}", "assign one name at a time")
        kind = self.typing.of(node.value)
        kinds = kind.removeprefix("tuple[").removesuffix("]").split(",") if kind.startswith("tuple[") else []
        if len(kinds) != len(target.elts):
            self.refuse(node, f"{len(target.elts)} names for a result of type {kind}", "give one name for each value")
        check_order(self.names, node, [node.value])
        for element, one in zip(target.elts, kinds, strict=True):
            if not isinstance(element, ast.Name):
                self.refuse(node, f"{ast.unparse(element)} among several targets", "unpack into locals first")
            self._store(element, one, None)

    def _annotated(self, node: ast.AnnAssign) -> None:
        if node.value is None or not isinstance(node.target, ast.Name):
            self.refuse(node, ast.unparse(node), "annotate locals that get a value")
        annotation = ast.unparse(node.annotation)
        if annotation not in SCALARS:
            self.refuse(node, f"a local of type {annotation}", "use float, int or bool")
        self.typing.wanted(node.value, annotation, "a value")
        check_order(self.names, node, [node.value])
        self._store(node.target, annotation, node.value)

    def _augmented(self, node: ast.AugAssign) -> None:
        before = self.typing.of(_read(node.target))
        kind = self.typing.binary(node, node.op, (before, self.typing.of(node.value)))
        check_order(self.names, node, [node.value, _read(node.target)])
        self._store(node.target, kind, None)

    def _store(self, target: ast.expr, kind: str, value: ast.expr | None) -> None:
        """Assign a value of this type."""
        if kind not in SCALARS:
            self.refuse(target, f"a value of type {kind} for {ast.unparse(target)}", "assign numbers and bools")
        if isinstance(target, ast.Name):
            self._store_local(target, kind)
            return
        root = target.value if isinstance(target, ast.Subscript) else target
        if not (isinstance(root, ast.Attribute) and isinstance(root.value, ast.Name) and root.value.id == "self"):
            self.refuse(target, f"an assignment to {ast.unparse(target)}", "assign locals and fields of self")
        wanted = self.typing.of(_read(target))
        if wanted.startswith("list["):
            self.refuse(target, f"an assignment to the whole array {ast.unparse(target)}", "assign element by element")
        if root.attr not in self.writable:
            self.refuse(target, f"an assignment to self.{root.attr}, a parameter or input,", "keep it in a state")
        if wanted != kind:
            text = f"float({ast.unparse(value)})" if value is not None else "float(...)"
            mend = f"write {text}" if (kind, wanted) == ("int", "float") else f"give {with_article(wanted)}"
            self.refuse(target, f"a value of type {kind} for {ast.unparse(target)} of type {wanted}", mend)

    def _store_local(self, target: ast.Name, kind: str) -> None:
        name = target.id
        if name == "self" or name in self.names.constants or name in self.names.functions:
            self.refuse(target, f"the local {name}, which hides another {name},", "choose another name")
        check_local(self.names.text, target, name)
        if name in self.loop_names:
            self.refuse(target, f"an assignment to the loop variable {name}", "use another local")
        if self.types.get(name, kind) != kind:
            self.refuse(target, f"{name}, first {self.types[name]}, then {kind},", "use two locals")
        self.types[name] = kind
        self.typing.known[name] = kind

    def _if(self, node: ast.If) -> bool:
        self.typing.wanted(node.test, "bool", "a condition")
        check_order(self.names, node, [node.test])
        before = dict(self.typing.known)
        ended = self.block(node.body)
        after = self.typing.known
        self.typing.known = dict(before)
        else_ended = self.block(node.orelse)
        if else_ended:
            self.typing.known = after
        elif not ended:
            self.typing.known = {name: kind for name, kind in self.typing.known.items() if name in after}
        return ended and else_ended

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            self.refuse(node, "while ... else", "use a bool")
        self.typing.wanted(node.test, "bool", "a condition")
        if isinstance(node.test, ast.Constant) and node.test.value and not _is_left(node.body):
            self.refuse(node, "while True without an end", "leave it by break or return, or test a condition")
        check_order(self.names, node, [node.test])
        before = dict(self.typing.known)
        self.block(node.body)
        self.typing.known = before  # the body may not have run

    def _for(self, node: ast.For) -> None:
        if node.orelse:
            self.refuse(node, "for ... else", "use a bool")
        called = node.iter
        if not (isinstance(called, ast.Call) and isinstance(called.func, ast.Name) and called.func.id == "range"
                and isinstance(node.target, ast.Name) and 1 <= len(called.args) <= 3 and not called.keywords):
            self.refuse(node, f"for {ast.unparse(node.target)} in {ast.unparse(node.iter)}", "loop over range(...)")
        for argument in called.args:
            self.typing.wanted(argument, "int", "an argument of range")
        if len(called.args) == 3 and not _is_number(called.args[2]):
            self.refuse(node, f"the range step {ast.unparse(called.args[2])}", "write a number other than 0")
        self._check_fixed(node, called)
        before = dict(self.typing.known)
        name = node.target.id
        self._store_local(node.target, "int")
        self.loop_names.append(name)
        self.block(node.body)
        self.loop_names.pop()
        self.typing.known = before
        self.typing.known.pop(name, None)  # after the loop C and Python differ in it

    def _check_fixed(self, node: ast.For, called: ast.Call) -> None:
        """C evaluates the bounds in every round, Python once: nothing in the body may change them."""
        read = {item.id for item in ast.walk(called) if isinstance(item, ast.Name)} - {"range"}
        fields = {item.attr for item in ast.walk(called) if isinstance(item, ast.Attribute)}
        for item in (inner for statement in node.body for inner in ast.walk(statement)):
            changed = (isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store) and item.id in read) or (
                isinstance(item, ast.Attribute) and bool(fields) and (
                    (isinstance(item.ctx, ast.Store) and item.attr in fields)
                    or (item.attr in self.names.changing and bool(fields & self.writable))))
            if changed:
                self.refuse(node, f"{ast.unparse(called)}, whose bounds may change in the loop,",
                            "keep the bound in a local before the loop")

    def _return(self, node: ast.Return) -> None:
        if node.value is None or self.result == "none":
            if node.value is not None or self.result != "none":
                self.refuse(node, ast.unparse(node), f"return {self.result}, as annotated")
            return
        values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
        kinds = self.result.removeprefix("tuple[").removesuffix("]").split(",")
        if self.result.startswith("tuple[") != isinstance(node.value, ast.Tuple) or len(values) != len(kinds):
            self.refuse(node, ast.unparse(node), f"return {self.result}, as annotated")
        for value, kind in zip(values, kinds, strict=True):
            self.typing.wanted(value, kind, "a returned value")
        check_order(self.names, node, values)


def _read(target: ast.expr) -> ast.expr:
    """The target of an assignment as an expression that reads it."""
    expression = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(expression, target)


def _index_of(target: ast.expr) -> list[ast.expr]:
    return [target.slice] if isinstance(target, ast.Subscript) else []


def _is_number(node: ast.expr) -> bool:
    operand = node.operand if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub) else node
    return isinstance(operand, ast.Constant) and type(operand.value) is int and operand.value != 0


def _is_left(body: list[ast.stmt]) -> bool:
    """Whether a loop with this body can be left: a return, or a break that is not of a loop inside."""
    for node in body:
        match node:
            case ast.Return() | ast.Break():
                return True
            case ast.If():
                if _is_left([*node.body, *node.orelse]):
                    return True
            case ast.While() | ast.For():
                if any(isinstance(item, ast.Return) for item in ast.walk(node)):
                    return True
    return False
