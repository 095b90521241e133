"""The subset of Python that every flavour can be built from, held before anything is built.

Inside it the dataclass, the plain module and the C that Pyccel makes of it calculate the same bits. What would be
refused by Pyccel, translated with another meaning, or break the C is refused here with file, line, construct and mend.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from pathlib import Path

from threadpitch.fmu.c_names import C_NAMES
from threadpitch.fmu.calls import check_calls
from threadpitch.fmu.expressions import CONSTANTS, MATHEMATICS, Names, Signature, Typing, refuse
from threadpitch.fmu.model import REQUIRED_METHODS, Model
from threadpitch.fmu.source_text import SourceText, own_text
from threadpitch.fmu.statements import check_function

ELEMENTARY = "threadpitch.fmu.elementary"
ELEMENTARY_PATH = Path(__file__).with_name("elementary.py")
_ELEMENTARY_TEXT = own_text(ELEMENTARY_PATH)
_IMPORTS = {"__future__": {"annotations"}, "dataclasses": {"dataclass"}, "math": {"floor", "sqrt", "pi"},
            "threadpitch.fmu.variable": {"Clock", "Experiment", "Terminal", "input_", "output", "parameter", "state"}}
_DECLARATIONS = ("ERRORS", "EXPERIMENT", "CLOCKS", "TERMINALS")

def check_subset(model: Model) -> None:
    """Refuse a model that leaves the subset.

    Raises:
        ModelError: the first construct outside the subset, with file, line and what to write instead.
    """
    tree = model.text.tree()
    fields = {variable.name: variable.kind if variable.size is None else f"list[{variable.kind}]"
              for variable in model.variables}
    writable = frozenset(variable.name for variable in model.variables if variable.causality in ("output", "local"))
    shared = _imports(model.text, tree)
    model_class = _checked_body(model.text, tree)
    methods = [node for node in model_class.body if isinstance(node, ast.FunctionDef)]
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    for node in functions:
        _check_name(model.text, node, node.name)
        if node.name in REQUIRED_METHODS:
            refuse(model.text, node, f"a function {node.name} outside the class", "choose another name")
    names = Names(
        text=model.text,
        constants=_constants(model.text, tree),
        functions=shared | {node.name: signature(model.text, node, node.args.args) for node in functions},
        fields=fields,
        methods={node.name: signature(model.text, node, node.args.args[1:]) for node in methods},
        changing=_changing(methods),
        sizes={variable.name: variable.size for variable in model.variables if variable.size is not None},
    )
    check_calls(model.text, [*functions, *methods])
    for node in functions:
        check_function(Names(names.text, names.constants, names.functions), node, frozenset())
    for node in methods:
        check_function(names, node, writable)


def elementary_functions() -> dict[str, Signature]:
    """The functions of ``threadpitch.fmu.elementary`` with their signatures."""
    tree = _ELEMENTARY_TEXT.tree()
    return {node.name: signature(_ELEMENTARY_TEXT, node, node.args.args)
            for node in tree.body if isinstance(node, ast.FunctionDef)}


def check_elementary() -> None:
    """Hold ``threadpitch.fmu.elementary`` to the same subset.

    Raises:
        ModelError: it leaves the subset.
    """
    tree = _ELEMENTARY_TEXT.tree()
    names = Names(_ELEMENTARY_TEXT, _constants(_ELEMENTARY_TEXT, tree), elementary_functions() | MATHEMATICS)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            check_function(names, node, frozenset())


def signature(text: SourceText, node: ast.FunctionDef, arguments: Iterable[ast.arg]) -> Signature:
    """The annotated types of a function.

    Raises:
        ModelError: an annotation is missing or not a type of the subset, or there are defaults, ``*`` or decorators.
    """
    extra = node.args
    if extra.defaults or extra.kwonlyargs or extra.posonlyargs or extra.vararg or extra.kwarg or node.decorator_list:
        refuse(text, node, f"{node.name} with defaults, *, keywords or a decorator", "give plain arguments")
    kinds = []
    for argument in arguments:
        kind = ast.unparse(argument.annotation) if argument.annotation else "nothing"
        if kind not in ("float", "int", "bool", "list[float]", "list[int]", "list[bool]"):
            refuse(text, argument, f"argument {argument.arg} annotated with {kind}", "annotate float, int or bool")
        kinds.append(kind)
    result = ast.unparse(node.returns).replace(" ", "") if node.returns else "nothing"
    parts = result.removeprefix("tuple[").removesuffix("]").split(",") if result.startswith("tuple[") else [result]
    if result == "None":
        return Signature(tuple(kinds), "none")
    if any(part not in ("float", "int", "bool") for part in parts):
        refuse(text, node, f"{node.name} returning {result}", "annotate float, int, bool, None or a tuple of them")
    return Signature(tuple(kinds), result)


def _imports(text: SourceText, tree: ast.Module) -> dict[str, Signature]:
    """The functions that the file imports."""
    allowed = _IMPORTS | {ELEMENTARY: set(elementary_functions())}
    available = elementary_functions() | MATHEMATICS
    found: dict[str, Signature] = {}
    for node in tree.body:
        if isinstance(node, ast.Import):
            refuse(text, node, ast.unparse(node), "import names: from math import floor, sqrt, pi")
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.module not in allowed:
            refuse(text, node, f"an import from {node.module}", f"import from {', '.join(sorted(allowed))} only")
        for alias in node.names:
            if alias.name not in allowed[node.module] or alias.asname is not None:
                refuse(text, node, ast.unparse(node), f"import {', '.join(sorted(allowed[node.module]))}, without as")
            if alias.name in available:
                found[alias.name] = available[alias.name]
    return found


def _checked_body(text: SourceText, tree: ast.Module) -> ast.ClassDef:
    """The one class; every other statement of the module is an import, a constant, a function or the docstring."""
    classes = []
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            classes.append(node)
        elif not isinstance(node, ast.ImportFrom | ast.Import | ast.Assign | ast.AnnAssign | ast.FunctionDef) \
                and not _is_docstring(node):
            refuse(text, node, f"{type(node).__name__} in a module", "keep constants, functions and one dataclass")
    model_class = classes[0]
    if len(classes) > 1:
        refuse(text, classes[1], f"a second class {classes[1].name}", "keep one class per file")
    decorators = [ast.unparse(decorator) for decorator in model_class.decorator_list]
    if model_class.bases or model_class.keywords or decorators != ["dataclass"]:
        refuse(text, model_class, f"{model_class.name} with bases, other decorators or arguments of @dataclass",
               "write @dataclass alone and no base class")
    for item in model_class.body:
        if isinstance(item, ast.FunctionDef):
            _check_method(text, item)
        elif not isinstance(item, ast.AnnAssign) and not _is_docstring(item):
            refuse(text, item, f"{ast.unparse(item).splitlines()[0]} in the class",
                   "keep fields and methods; put constants above the class")
    return model_class


def _check_method(text: SourceText, node: ast.FunctionDef) -> None:
    private = node.name.startswith("_") and not node.name.startswith("__")
    if node.name not in REQUIRED_METHODS and not private:
        refuse(text, node, f"a method {node.name}", f"name it _{node.name.strip('_')}: it is private to the model")
    if not node.args.args or node.args.args[0].arg != "self":
        refuse(text, node, f"{node.name} without self", "write def " + node.name + "(self, ...)")
    expected = {"check": "int", "initialize": "None", "step": "int"}.get(node.name)
    if expected is not None and (node.returns is None or ast.unparse(node.returns) != expected):
        refuse(text, node, f"{node.name} not annotated -> {expected}", f"write def {node.name}(...) -> {expected}")


def _check_name(text: SourceText, node: ast.stmt, name: str) -> None:
    if name in C_NAMES or name in MATHEMATICS or name in CONSTANTS or name.startswith("elementary_"):
        refuse(text, node, f"the name {name}, which has a meaning in C or in the module made of this,",
               "choose another name")


def _constants(text: SourceText, tree: ast.Module) -> Mapping[str, str]:
    """Names and types of the numbers at the top of the file; others (texts for the declaration) have no type."""
    found = dict(CONSTANTS)
    for node in tree.body:
        if isinstance(node, ast.Assign):
            if len(node.targets) != 1 or not isinstance(node.targets[0], ast.Name):
                refuse(text, node, ast.unparse(node), "assign one name at a time")
            name, value = node.targets[0].id, node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            name, value = node.target.id, node.value
        else:
            continue
        if name in _DECLARATIONS or isinstance(value, ast.Dict | ast.Tuple | ast.List) or (
                isinstance(value, ast.Constant) and isinstance(value.value, str)):
            continue  # for the declaration; a method that used it would be refused
        _check_name(text, node, name)
        if name in found:
            refuse(text, node, f"a second value of {name}", "give a constant one value")
        found[name] = Typing(Names(text, found, {}), {}).of(value)
    return found


def _changing(methods: Iterable[ast.FunctionDef]) -> frozenset[str]:
    """The methods that assign a field, themselves or through the methods that they call."""
    calls: dict[str, set[str]] = {}
    changing = set()
    for method in methods:
        attributes = [item for item in ast.walk(method) if isinstance(item, ast.Attribute)]
        calls[method.name] = {item.attr for item in attributes}
        stored = any(isinstance(item.ctx, ast.Store) for item in attributes)
        elements = any(isinstance(item, ast.Subscript) and isinstance(item.ctx, ast.Store) for item in ast.walk(method))
        if stored or elements:
            changing.add(method.name)
    while True:
        more = {name for name, called in calls.items() if called & changing} - changing
        if not more:
            return frozenset(changing)
        changing |= more


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
