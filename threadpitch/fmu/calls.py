"""Who calls whom in a model file: nothing may call itself."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from threadpitch.fmu.expressions import refuse
from threadpitch.fmu.source_text import SourceText


def check_calls(text: SourceText, functions: Sequence[ast.FunctionDef]) -> None:
    """Refuse functions and methods that call themselves, directly or through others.

    Raises:
        ModelError: the first one that does; native code has no bound on how deep it would go.
    """
    called = {node.name: _called(node) for node in functions}
    for node in functions:
        reached: set[str] = set()
        waiting = set(called[node.name])
        while waiting:
            name = waiting.pop()
            if name not in reached:
                reached.add(name)
                waiting |= called.get(name, set())
        if node.name in reached:
            refuse(text, node, f"{node.name}, which calls itself" + ("" if node.name in called[node.name] else
                                                                     " through others") + ",", "write a loop")


def _called(node: ast.FunctionDef) -> set[str]:
    """Names of functions and methods of this file that are called, if they are of this file."""
    names = set()
    for item in ast.walk(node):
        if isinstance(item, ast.Call):
            if isinstance(item.func, ast.Name):
                names.add(item.func.id)
            elif isinstance(item.func, ast.Attribute) and ast.unparse(item.func.value) == "self":
                names.add(item.func.attr)
    return names
