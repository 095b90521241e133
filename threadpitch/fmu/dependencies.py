"""What the outputs depend on: directly (declared by ``depends_on``) and at initialisation (read from the source)."""

from __future__ import annotations

import ast

from threadpitch.fmu.model import Model, Scalar


def direct(all_scalars: tuple[Scalar, ...], output: Scalar) -> tuple[Scalar, ...]:
    """The inputs on which an output depends directly at a communication point."""
    return tuple(scalar for scalar in all_scalars if scalar.variable.name in output.variable.depends_on)


def initial(model: Model, all_scalars: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
    """The parameters and inputs that ``initialize`` and the methods that it calls read.

    Every output may depend on all of these after initialisation; on nothing else it can.
    """
    read = _read_by(model, "initialize")
    return tuple(scalar for scalar in all_scalars
                 if scalar.variable.name in read and scalar.variable.causality in ("parameter", "input"))


def _read_by(model: Model, method: str) -> set[str]:
    """Names of attributes of ``self`` that a method reads, itself or through the methods that it calls."""
    tree = model.text.tree()
    model_class = next(node for node in tree.body if isinstance(node, ast.ClassDef))
    methods = {node.name: node for node in model_class.body if isinstance(node, ast.FunctionDef)}
    read: set[str] = set()
    waiting, done = [method], set()
    while waiting:
        name = waiting.pop()
        done.add(name)
        for node in ast.walk(methods[name]):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
                read.add(node.attr)
        waiting += [called for called in read & methods.keys() if called not in done and called not in waiting]
    return read
