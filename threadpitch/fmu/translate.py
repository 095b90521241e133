"""The equations of a model in C: Pyccel translates the plain module.

The module that Pyccel reads differs from the plain module of Python in this: constants stand in it as numbers (C would
keep them in global variables), arrays are numpy arrays, ``self`` and array arguments are annotated, and class and
functions have names that C's libraries do not use. What Pyccel writes is joined by ``c/translated.h``, which holds what
such code calls; Pyccel's own headers abort the host on a bad index and do not compile everywhere.
"""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import importlib.util
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from threadpitch.fmu import elementary
from threadpitch.fmu.cache import cache_folder, write_folder
from threadpitch.fmu.failure import BuildError
from threadpitch.fmu.model import Model
from threadpitch.fmu.plain import PREFIX, Dialect, content_hash, module_text
from threadpitch.fmu.source_text import SourceText
from threadpitch.fmu.subset import check_subset
from threadpitch.fmu.variable import ModelError, Variable

FUNCTION_PREFIX = "function_"  # of the model file's own functions
_ARRAYS = {"float": "float[:]", "int": "int[:]", "bool": "bool[:]"}
_MEMBERS = {("float", False): "double", ("int", False): "int64_t", ("bool", False): "bool",
            ("float", True): "array_double_1d", ("int", True): "array_int64_t_1d", ("bool", True): "array_bool_1d"}
_PYCCEL = "import sys; from pyccel.commands.console import pyccel; sys.exit(pyccel())"
_MESSAGE = re.compile(r"\|\s*(?:error|fatal)[^:]*: \S+ \[(\d+),\d+\]\|\s*(.*)")
# what c/translated.h stands for: the head of a header that Pyccel writes
_HEAD = re.compile(r'#include .*|#define (i_key|STC_CSPAN_INDEX_TYPE) \w+|#(ifndef|define) _(TOOLS_COMMON|ARRAY)_\w+'
                   r'|#endif // _(TOOLS_COMMON|ARRAY)_\w+|using_cspan\(array_\w+_1d, \w+, 1\);|')
_FUNCTION = re.compile(r"(?:double|int64_t|bool|void) \w+\(.*\);$")
_MANY = re.compile(r"\b\w+_(?:min|max)\((\d+),")
_MOST_COMPARED = 6  # c/translated.h


@dataclass(frozen=True)
class Equations:
    """A model's equations in C: ``equations.h`` declares ``struct <class_name>`` and its functions."""

    class_name: str
    header: str
    source: str


def translate(model: Model) -> Equations:
    """The equations of a model in C, from the cache where they have been translated before.

    Raises:
        ModelError: the model leaves the subset, or Pyccel does not translate it (file, line, construct).
        BuildError: Pyccel is not installed.
        OSError: the cache cannot be written.
    """
    check_subset(model)
    if importlib.util.find_spec("pyccel") is None:
        raise BuildError("Pyccel is not installed; install it with: pip install pyccel==2.0.1, "
                         "or build with --flavor python")
    class_name = f"{model.class_name}Model"
    text = module_text(model, _dialect(model, class_name))
    version = importlib.metadata.version("pyccel")
    key = content_hash(f"{version}\n{Path(__file__).read_text(encoding='utf-8')}\n{text}")
    folder = cache_folder() / "translation" / f"{model.class_name}_{key}"
    found = _cached(folder)
    if found is None:
        found = _translated(model, text)
        write_folder(folder, {name: content.encode() for name, content in found.items()})
    comment = f"/* {model.class_name}, translated by Pyccel {version} from {model.path.name}: edit that instead. */\n"
    _check_members(model, class_name, found["equations.h"])
    return Equations(class_name, comment + found["equations.h"], comment + found["equations.c"])


# The module that Pyccel reads ---------------------------------------------------------------------------------------


def _dialect(model: Model, class_name: str) -> Dialect:
    own = model.model_class.step.__globals__
    numbers = {name: value for name, value in own.items() if type(value) in (bool, int, float)}
    numbers |= {f"{PREFIX}{name}": value for name, value in vars(elementary).items() if type(value) in (int, float)}
    functions = {node.name for node in model.text.tree().body if isinstance(node, ast.FunctionDef)}
    arrays = any(variable.size is not None for variable in model.variables)
    numbers["pi"] = math.pi
    return Dialect(class_name, _filled, lambda node: _ForC(class_name, numbers, functions).visit_FunctionDef(node),
                   ("from numpy import full",) if arrays else ())


def _filled(variable: Variable) -> str:
    kind = "" if variable.kind == "float" else f", dtype={variable.kind}"
    return f"full({variable.size}, {variable.start!r}{kind})"


class _ForC(ast.NodeTransformer):
    """One function as Pyccel reads it."""

    def __init__(self, class_name: str, numbers: Mapping[str, float], functions: set[str]) -> None:
        self.class_name = class_name
        self.numbers = dict(numbers)
        self.functions = functions

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """Annotate, rename, and write constants as numbers."""
        for argument in node.args.args:
            self.numbers.pop(argument.arg, None)  # an argument hides the constant
            if argument.arg == "self":
                argument.annotation = ast.Constant(self.class_name)
            elif argument.annotation is not None and ast.unparse(argument.annotation).startswith("list["):
                kind = ast.unparse(argument.annotation)[len("list["):-1]
                argument.annotation = ast.Constant(_ARRAYS[kind])
        if node.name in self.functions:
            node.name = f"{FUNCTION_PREFIX}{node.name}"
        node.body = [self.visit(statement) for statement in node.body]
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A constant's value, a function's new name, or what stood there."""
        if node.id in self.functions:
            return ast.Name(f"{FUNCTION_PREFIX}{node.id}", node.ctx)
        if node.id not in self.numbers or isinstance(node.ctx, ast.Store):
            return node
        value = self.numbers[node.id]
        if not isinstance(value, bool) and math.copysign(1.0, value) < 0.0:
            return ast.UnaryOp(ast.USub(), ast.Constant(-value))
        return ast.Constant(value)


# Pyccel -------------------------------------------------------------------------------------------------------------


def _cached(folder: Path) -> dict[str, str] | None:
    try:
        return {name: (folder / name).read_text(encoding="utf-8") for name in ("equations.h", "equations.c")}
    except FileNotFoundError:
        return None


def _translated(model: Model, text: str) -> dict[str, str]:
    """Run Pyccel in a process and a folder of its own, and adapt what it writes to ``c/translated.h``."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYCCEL_")}
    with tempfile.TemporaryDirectory(prefix="threadpitch-") as name:
        folder = Path(name)
        (folder / "equations.py").write_text(text, encoding="utf-8")
        command = [sys.executable, "-P", "-c", _PYCCEL, "-t", "--language", "c", "equations.py", "--output", "out"]
        # the order in which it frees arrays follows the hash of names
        done = subprocess.run(command, cwd=folder, env=environment | {"PYTHONHASHSEED": "0", "PYTHONUTF8": "1"},
                              capture_output=True, text=True, encoding="utf-8", errors="replace", check=False)
        if done.returncode != 0:
            raise ModelError(_failure(model, text, done.stdout + done.stderr))
        written = next((folder / "out").glob("__pyccel__*"))  # under pytest-xdist its name ends with the worker
        header = (written / "equations.h").read_text(encoding="utf-8")
        source = (written / "equations.c").read_text(encoding="utf-8")
    public, private = _parted(model, header)
    return {"equations.h": _header(model, public), "equations.c": _source(model, source, private)}


def _failure(model: Model, text: str, output: str) -> str:
    """The one-line message for what Pyccel said: the model's file and line, the construct, the mend."""
    found = _MESSAGE.search(output)
    if found is None:
        last = output.strip().splitlines()[-1:] or ["no message"]
        return f"{model.path}: Pyccel does not translate the model ({last[0].strip()}); build it with --flavor python"
    number = int(found[1])
    construct = text.splitlines()[number - 1].strip()
    line = source_line(model, text, number)
    return (f"{model.text.place(line)}: {construct}: Pyccel does not translate this ({found[2].strip()}); "
            "write it more simply, or build with --flavor python")


def source_line(model: Model, text: str, number: int) -> int:
    """The line of the model's text that line ``number`` of the module made from it came from."""
    original = _original_functions(model.text)
    for name, node in _made_functions(text).items():
        own = original.get(name.removeprefix(FUNCTION_PREFIX))
        if not node.lineno <= number <= (node.end_lineno or node.lineno) or own is None:
            continue
        statements = [item for item in ast.walk(own) if isinstance(item, ast.stmt)]
        if ast.get_docstring(own) is not None:
            statements.remove(own.body[0])
        pairs = zip((item for item in ast.walk(node) if isinstance(item, ast.stmt)), statements, strict=False)
        lines = [(there.lineno, here.lineno) for there, here in pairs if there.lineno <= number]
        return max(lines)[1] if lines else own.lineno
    return 1


@functools.lru_cache(maxsize=8)
def _made_functions(text: str) -> dict[str, ast.FunctionDef]:
    return _functions(ast.parse(text))


@functools.lru_cache(maxsize=8)
def _original_functions(text: SourceText) -> dict[str, ast.FunctionDef]:
    return _functions(text.tree())


def _functions(tree: ast.Module) -> dict[str, ast.FunctionDef]:
    return {node.name: node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


# What Pyccel wrote --------------------------------------------------------------------------------------------------


def _parted(model: Model, header: str) -> tuple[str, list[str]]:
    """The header without the functions that only the equations call, and the declarations of those."""
    own = rf"{model.class_name}Model__(?:init__|del__|check|initialize|step)\("
    lines = header.splitlines(keepends=True)
    private = [line for line in lines if _FUNCTION.match(line) and not re.search(own, line)]
    return "".join(line for line in lines if line not in private), private


def _header(model: Model, text: str) -> str:
    """The header with ``translated.h`` in place of Pyccel's includes and array types."""
    head, struct, rest = text.partition("struct ")
    unknown = [line for line in head.splitlines()[2:] if not _HEAD.fullmatch(line.strip())]
    if not struct or unknown:
        raise ModelError(f"{model.path}: Pyccel writes C that is not known here ({(unknown or ['no struct'])[0]}); "
                         "install pyccel==2.0.1, or build with --flavor python")
    return '#ifndef EQUATIONS_H\n#define EQUATIONS_H\n\n#include "translated.h"\n\n' + struct + rest


def _source(model: Model, text: str, private: list[str]) -> str:
    """The source with its private functions static: the compiler then puts them where they are called."""
    too_many = [int(count) for count in _MANY.findall(text) if int(count) > _MOST_COMPARED]
    if too_many:
        raise ModelError(f"{model.path}: min or max of {max(too_many)} numbers cannot be in a native FMU; "
                         f"compare {_MOST_COMPARED} at a time")
    for line in private:
        text = text.replace(f"\n{line.rstrip().removesuffix(';')}\n", f"\nstatic {line.rstrip().removesuffix(';')}\n")
    declared = "".join(f"static {line}" for line in private)
    text = text.replace('#include "equations.h"\n', f'#include "equations.h"\n\n{declared}', 1)
    # Pyccel writes labs, which has 32 bits on Windows
    return re.sub(r"\blabs\(", "llabs(", text)


def _check_members(model: Model, class_name: str, header: str) -> None:
    """Hold the struct to the declaration: the table of variables takes the members by name and type."""
    struct = re.search(rf"struct {class_name} {{(.*?)}};", header, re.DOTALL)
    members = set(re.findall(r"(\w+) (\w+);", struct[1])) if struct else set()
    for variable in model.variables:
        wanted = _MEMBERS[variable.kind, variable.size is not None]
        if (wanted, variable.name) not in members:
            raise ModelError(f"{model.path}: the field {variable.name} does not come out as {wanted} in C; rename it")
