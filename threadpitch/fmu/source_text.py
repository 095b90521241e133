"""The source of a model: its file, and above it the files beside it that it imports from.

    from ._axis_motion import AxisMotion, stopping_velocity      # fmu_src/_axis_motion.py

A part has a leading underscore, so that it is taken for no model of its own. It holds constants, functions of numbers
and at most one dataclass that the model's class, or that of another part, derives from: with it a long model has its
fields and methods in several files. All of them together are held to the subset as if they stood in one file.
"""

from __future__ import annotations

import ast
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from threadpitch.fmu.variable import ModelError


@dataclass(frozen=True)
class SourceText:
    """The text of a model with its parts, one after the other, the model's own file last."""

    path: Path
    source: str
    begins: tuple[tuple[int, Path], ...]  # first line of each file, from 1

    def place(self, line: int) -> str:
        """``file:line`` of a line of the text."""
        begin, path = max((begin, path) for begin, path in self.begins if begin <= line)
        return f"{path}:{line - begin + 1}"

    def file(self, node: ast.AST) -> Path:
        """The file that a node of the text stands in."""
        return max((begin, path) for begin, path in self.begins if begin <= getattr(node, "lineno", 1))[1]

    def tree(self) -> ast.Module:
        """The text parsed anew, with the classes of the parts taken into the class that derives from them.

        Raises:
            ModelError: a field or method of a part is defined again.
        """
        tree = ast.parse(self.source)
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        if classes:
            self._take_in(tree, classes[-1], {node.name: node for node in classes})
        return tree

    def _take_in(self, tree: ast.Module, derived: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> None:
        while len(derived.bases) == 1 and isinstance(derived.bases[0], ast.Name):
            base = classes.get(derived.bases[0].id)
            if base is None or base is derived or self.file(base) == self.file(derived) or base not in tree.body:
                return
            taken = _members(base)
            for name, node in _members(derived).items():
                if name in taken:
                    raise ModelError(f"{self.place(node.lineno)}: {name} is defined in {self.place(taken[name].lineno)}"
                                     " too; give it another name")
            head = 0 if ast.get_docstring(derived) is None else 1
            body = base.body if ast.get_docstring(base) is None else base.body[1:]
            derived.body[head:head] = body
            derived.bases = base.bases
            tree.body.remove(base)


def source_text(path: Path) -> SourceText:
    """The text of a model's file and of its parts.

    Raises:
        ModelError: a file cannot be read, or an import from beside the model is none that can be joined.
    """
    pieces: list[tuple[Path, str]] = []
    _join(path, pieces, ())
    begins, line = [], 1
    for file, text in pieces:
        begins.append((line, file))
        line += text.count("\n")
    joined = SourceText(path, "".join(text for _, text in pieces), tuple(begins))
    if len(pieces) > 1:
        _check_names(joined)
    return joined


def own_text(path: Path) -> SourceText:
    """A file that has no parts."""
    return SourceText(path, _read(path), ((1, path),))


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ModelError(f"{path}: the model cannot be read ({error.strerror}); give the path of a .py file") from error
    except UnicodeDecodeError as error:
        raise ModelError(f"{path}: the model is not UTF-8 text; save it as UTF-8") from error


@functools.lru_cache(maxsize=64)
def _parsed(source: str) -> ast.Module:
    """For looking at: models are read many times."""
    return ast.parse(source)


def _join(path: Path, pieces: list[tuple[Path, str]], above: tuple[Path, ...]) -> None:
    """Put the parts of a file and then the file itself behind the pieces; an import of a part leaves empty lines."""
    source = _read(path)
    try:
        tree = _parsed(source)
    except SyntaxError as error:
        raise ModelError(f"{path}:{error.lineno}: {error.msg}; this is not Python that can be read") from error
    lines = source.removesuffix("\n").split("\n")
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.level > 0:
            part = _part(path, node)
            if part in above or part == path:
                _refuse(path, node, "imports in a circle", "let the parts import downwards only")
            if part not in [done for done, _ in pieces]:
                _join(part, pieces, (*above, path))
            _check_imported(path, node, part)
        if isinstance(node, ast.ImportFrom) and (node.level > 0 or (node.module == "__future__" and above)):
            for number in range(node.lineno - 1, node.end_lineno or node.lineno):
                lines[number] = ""
    pieces.append((path, "\n".join(lines) + "\n"))


def _part(path: Path, node: ast.ImportFrom) -> Path:
    """The file that ``from ._part import ...`` names."""
    if node.level != 1 or node.module is None or "." in node.module or not node.module.startswith("_"):
        _refuse(path, node, "is no import of a part", "write from ._part import name, of a file beside the model whose "
                                                      "name begins with _")
    part = path.with_name(f"{node.module}.py")
    if not part.is_file():
        _refuse(path, node, f"finds no file {part.name} beside the model", "mend the name")
    return part


def _check_imported(path: Path, node: ast.ImportFrom, part: Path) -> None:
    defined = _defined(_parsed(_read(part)))
    for alias in node.names:
        if alias.asname is not None:
            _refuse(path, node, "gives a part's name another one", "import it without as")
        if alias.name not in defined:
            _refuse(path, node, f"finds no {alias.name} in {part.name}", "mend the name")


@functools.lru_cache(maxsize=64)
def _check_names(text: SourceText) -> None:
    """What two files define under one name would be one thing in the joined text."""
    seen: dict[str, ast.stmt] = {}
    for node in _parsed(text.source).body:
        for name in _defined_by(node):
            if name in seen and text.file(node) != text.file(seen[name]):
                raise ModelError(f"{text.place(node.lineno)}: {name} is defined in {text.place(seen[name].lineno)} "
                                 "too; import it from there, or give it another name")
            seen[name] = node


def _defined(tree: ast.Module) -> set[str]:
    return {name for node in tree.body for name in _defined_by(node)}


def _defined_by(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


def _members(node: ast.ClassDef) -> dict[str, ast.stmt]:
    return {name: item for item in node.body for name in _defined_by(item)}


def _refuse(path: Path, node: ast.stmt, what: str, mend: str) -> NoReturn:
    raise ModelError(f"{path}:{node.lineno}: {ast.unparse(node)} {what}; {mend}")
