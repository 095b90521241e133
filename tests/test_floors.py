"""The house holds: each floor imports only what is below it, no circles, no plotting below the reports."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FLOORS = (
    {"units", "compiled"},
    {"trace", "cycles", "fmu"},
    {"pitch", "cosim"},
    {"passes"},
    {"live_turns"},
    {"judgement", "tolerance", "store", "parameters", "replacement", "workpiece"},
    {"roles"},
    {"lathe", "sparkline"},
    {"measuring"},
    {"diagnosis"},
    {"tables", "studies", "drive_fit", "system_archive", "approach", "program_parameters", "faults",
     "control_chart"},
    {"runs"},
    {"publish", "run_folder", "system_report", "study_report"},
    {"report"},
    {"serve"},
    {"cli"},
    {"__main__"},
)
FLOOR_OF = {name: number for number, floor in enumerate(FLOORS) for name in floor}
DECLARATION = {"threadpitch.fmu.variable", "threadpitch.fmu.elementary"}
PLOTTING = {"matplotlib", "plotly", "bokeh", "altair", "seaborn"}


def imports(path: Path) -> set[str]:
    """Dotted names of all modules that a file imports when it runs, wherever in it."""
    found: set[str] = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.module is not None
            if node.level == 0:
                found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
            else:
                assert is_import_of_a_part(path, node), f"{path}: relative import"
    return found


def is_import_of_a_part(path: Path, node: ast.ImportFrom) -> bool:
    """``from ._part import name`` of a file beside a model: it becomes one text with the model."""
    return path.parent == ROOT / "fmu_src" and node.level == 1 and f"{node.module}".startswith("_")


def part(path: Path) -> str:
    return path.relative_to(ROOT / "threadpitch").parts[0].removesuffix(".py")


LIBRARY = sorted(path for path in (ROOT / "threadpitch").rglob("*.py")
                 if part(path) not in {"__init__", "fmu_src", "models"})


@pytest.mark.parametrize("path", LIBRARY, ids=lambda path: str(path.relative_to(ROOT)))
def test_each_floor_imports_only_what_is_below(path: Path) -> None:
    own = part(path)
    assert own in FLOOR_OF, f"{own} has no floor; give it one in this test and in the README"
    for name in imports(path):
        words = name.split(".")
        if words[0] == "threadpitch" and len(words) > 1 and words[1] in FLOOR_OF and words[1] != own:
            assert FLOOR_OF[words[1]] < FLOOR_OF[own], f"{path} imports {name}, which is not below {own}"
        if words[0] in PLOTTING:
            assert FLOOR_OF[own] >= FLOOR_OF["report"], f"{path} imports {name} below the reports"


@pytest.mark.parametrize("path", sorted((ROOT / "fmu_src").glob("*.py")), ids=lambda path: path.name)
def test_models_import_only_the_declaration(path: Path) -> None:
    for name in imports(path):
        words = name.split(".")
        assert words[0] in {"dataclasses", "math"} or ".".join(words[:3]) in DECLARATION | {"threadpitch.fmu"}, name
        if words[0] == "threadpitch":
            assert ".".join(words[:3]) in DECLARATION


def test_package_itself_imports_no_command_line() -> None:
    """``import threadpitch`` must stay light and never reach the top floor."""
    assert not {name for name in imports(ROOT / "threadpitch" / "__init__.py") if name.startswith("threadpitch.cli")}


def test_modules_of_a_part_make_no_circle() -> None:
    graph = {}
    for path in LIBRARY:
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        graph[module] = {name for name in imports(path) if name.startswith("threadpitch.")}
    done: set[str] = set()

    def visit(module: str, above: tuple[str, ...]) -> None:
        assert module not in above, " -> ".join((*above, module))
        if module in done:
            return
        for name in graph[module] & graph.keys():
            if name != module and not module.startswith(name + "."):
                visit(name, (*above, module))
        done.add(module)

    for module in graph:
        visit(module, ())
