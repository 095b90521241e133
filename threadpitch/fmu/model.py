"""A model file read: the one dataclass of the file as a frozen record of what it declares.

Everything that is generated (description, plain module, FMU, documentation) starts from this record.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import hashlib
import importlib.util
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any

from threadpitch.fmu.declaration import Place, checked_variable
from threadpitch.fmu.links import check_variables, checked_clocks, checked_terminals
from threadpitch.fmu.source_text import SourceText, source_text
from threadpitch.fmu.variable import KEY, Clock, Experiment, ModelError, Terminal, Variable

# name -> the arguments that the method must have
REQUIRED_METHODS = {"check": ("self",), "initialize": ("self",), "step": ("self", "time", "step_size")}


@dataclass(frozen=True, eq=False)  # one object for one content: see read_model
class Model:
    """What a model file declares: variables in the order of the fields, declared errors, default experiment."""

    class_name: str
    description: str  # the class docstring
    variables: tuple[Variable, ...]
    errors: Mapping[int, str]
    experiment: Experiment | None
    text: SourceText
    model_class: type[Any]
    clocks: tuple[Clock, ...] = ()
    terminals: tuple[Terminal, ...] = ()

    @property
    def path(self) -> Path:
        """The model's file."""
        return self.text.path

    @property
    def source(self) -> str:
        """The text of the file and of its parts."""
        return self.text.source

    def variable(self, name: str) -> Variable:
        """The variable of this name.

        Raises:
            KeyError: the model has no such variable.
        """
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(name)


@dataclass(frozen=True)
class Scalar:
    """One scalar of FMI 2: a variable, or element ``index`` (from 0) of an array, with its value reference."""

    name: str
    reference: int
    variable: Variable
    index: int | None


def scalars(model: Model) -> tuple[Scalar, ...]:
    """The scalars of FMI 2 in the order of the fields; an array ``a`` gives ``a[1]``, ``a[2]``, ..."""
    found: list[Scalar] = []
    for variable in model.variables:
        if variable.size is None:
            found.append(Scalar(variable.name, len(found), variable, None))
        else:
            for index in range(variable.size):
                found.append(Scalar(f"{variable.name}[{index + 1}]", len(found), variable, index))
    return tuple(found)


def read_model(path: Path | str) -> Model:
    """The model that a Python file declares. The file is imported under a name of its own.

    Raises:
        ModelError: the file cannot be read or imported, or a declaration does not make sense (file, line, mend).
    """
    return _read(source_text(Path(path)))


@functools.lru_cache(maxsize=64)
def _read(text: SourceText) -> Model:
    path = text.path
    tree = text.tree()
    module = _imported(text)
    model_class = _only_dataclass(path, module)
    node = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == model_class.__name__)
    _check_methods(text, node)
    variables = _variables(text, node, model_class)
    places = _places(text, tree)
    return Model(
        class_name=model_class.__name__,
        description=ast.get_docstring(node) or "",
        variables=variables,
        errors=_errors(places["ERRORS"], module),
        experiment=_experiment(places["EXPERIMENT"], module),
        text=text,
        model_class=model_class,
        clocks=checked_clocks(places["CLOCKS"], getattr(module, "CLOCKS", ()), variables),
        terminals=checked_terminals(places["TERMINALS"], getattr(module, "TERMINALS", ()), variables),
    )


def _imported(text: SourceText) -> ModuleType:
    path = text.path
    digest = hashlib.sha256(f"{path}\n{text.source}".encode()).hexdigest()[:12]
    name = f"threadpitch_model_{path.stem}_{digest}"
    spec = importlib.util.spec_from_loader(name, loader=None, origin=str(path))
    assert spec is not None  # spec_from_loader returns None only for a loader that says so
    module = importlib.util.module_from_spec(spec)
    module.__file__ = str(path)
    sys.modules[name] = module  # dataclasses look up annotations written as text in the module of their class
    try:
        exec(compile(text.source, str(path), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        frames = traceback.extract_tb(error.__traceback__)
        lines = [frame.lineno or 1 for frame in frames if frame.filename == str(path)]
        where = text.place(lines[-1]) if lines else str(path)
        raise ModelError(f"{where}: {type(error).__name__}: {error}; the model cannot be imported") from error
    return module


def _only_dataclass(path: Path, module: ModuleType) -> type[Any]:
    found = [value for value in vars(module).values()
             if isinstance(value, type) and value.__module__ == module.__name__ and dataclasses.is_dataclass(value)]
    bases = {base for one in found for base in one.__mro__[1:]}
    found = [one for one in found if one not in bases]
    if len(found) != 1:
        names = ", ".join(value.__name__ for value in found) or "none"
        raise ModelError(f"{path}: a model file holds one dataclass, this one holds {names}; keep one model per file")
    return found[0]


def _variables(text: SourceText, node: ast.ClassDef, model_class: type[Any]) -> tuple[Variable, ...]:
    annotations = {item.target.id: item for item in node.body
                   if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)}
    found = []
    for field in dataclasses.fields(model_class):
        if field.name not in annotations:
            raise ModelError(f"{text.place(node.lineno)}: {field.name} comes from a base class; declare it in "
                             f"{node.name} or in a part of the model")
        item = annotations[field.name]
        place = Place(text.place(item.lineno), field.name)
        if KEY not in field.metadata:
            raise ModelError(place.says("the field is not declared", "use parameter, input_, output or state"))
        found.append(checked_variable(place, ast.unparse(item.annotation), field.metadata[KEY]))
    if not found:
        raise ModelError(f"{text.place(node.lineno)}: {node.name} declares no variable; add at least one field")
    check_variables({name: Place(text.place(item.lineno), name) for name, item in annotations.items()}, found)
    return tuple(found)


def _check_methods(text: SourceText, node: ast.ClassDef) -> None:
    methods = {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}
    for name, arguments in REQUIRED_METHODS.items():
        if name not in methods:
            raise ModelError(f"{text.place(node.lineno)}: {node.name} has no method {name}({', '.join(arguments)}); "
                             "add it")
        found = methods[name].args
        if tuple(argument.arg for argument in found.args) != arguments or found.defaults:
            raise ModelError(f"{text.place(methods[name].lineno)}: write it as {name}({', '.join(arguments)})")


def _places(text: SourceText, tree: ast.Module) -> Mapping[str, str]:
    """``file:line`` of the declarations beside the class; where there is none, the file."""
    places = dict.fromkeys(("ERRORS", "EXPERIMENT", "CLOCKS", "TERMINALS"), str(text.path))
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign):
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                if isinstance(target, ast.Name) and target.id in places:
                    places[target.id] = text.place(node.lineno)
    return places


def _errors(place: str, module: ModuleType) -> Mapping[int, str]:
    errors = getattr(module, "ERRORS", {})
    if not isinstance(errors, dict) or not all(
            type(number) is int and 0 < number < 2**31 and isinstance(text, str) for number, text in errors.items()):
        raise ModelError(f"{place}: ERRORS must be a dict of positive numbers and messages: {{1: 'what; how to mend'}}")
    return MappingProxyType(dict(errors))


def _experiment(place: str, module: ModuleType) -> Experiment | None:
    experiment = getattr(module, "EXPERIMENT", None)
    if experiment is None:
        return None
    if not isinstance(experiment, Experiment):
        raise ModelError(f"{place}: EXPERIMENT must be an Experiment(stop_time=..., step_size=...)")
    if not (experiment.start_time < experiment.stop_time and experiment.step_size > 0.0):
        raise ModelError(f"{place}: EXPERIMENT must have start_time < stop_time and a positive step_size")
    return experiment
