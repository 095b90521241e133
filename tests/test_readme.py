"""The README's commands and its Python are run as they stand; its pages are current."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import pytest

from threadpitch.cli import app, invoke

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
OPTIONS = "".join(page.read_text(encoding="utf-8") for page in PAGES)


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder beside which the shipped models lie, as in a checkout."""
    (tmp_path / "models").symlink_to(ROOT / "models", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_command_runs(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commands = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("threadpitch ")]
    assert len(commands) >= 6
    for command in commands:
        assert invoke(shlex.split(command)[1:]) == 0, command
        captured = capsys.readouterr()
        assert captured.out
        assert all(line.startswith("threadpitch: note: ") for line in captured.err.splitlines()), captured.err
    assert (workplace / "threadpitch-run" / "trace.csv").is_file()


def test_python_example_runs(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for block in blocks("python"):
        script = workplace / "example.py"
        script.write_text(block, encoding="utf-8")
        runpy.run_path(str(script))
    assert "(2, 10)" in capsys.readouterr().out


def test_parameter_file_example_runs(workplace: Path) -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    (workplace / "gains.toml").write_text(blocks("toml", page)[0], encoding="utf-8")
    assert invoke(["run", "--parameters", "gains.toml", "--stop-time", "0.6"]) == 0


def test_models_of_the_page_about_own_models_are_built(workplace: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "own_model.md").read_text(encoding="utf-8")
    models = re.findall(r"<!-- model: (\S+) -->\n```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    assert len(models) == 2
    for name, text in models:
        (workplace / name).write_text(text, encoding="utf-8")
    commands = re.findall(r"^threadpitch (.*)", page, flags=re.MULTILINE)
    assert len(commands) == 2
    for command in commands:
        assert invoke(command.split()) == 0, capsys.readouterr().err
    assert sorted(path.name for path in (workplace / "fmus").rglob("*.fmu")) == ["ThermalSpindle.fmu"] * 2
    capsys.readouterr()
    for options in ([], ["--fmi", "3"], ["--flavor", "python"]):
        assert invoke(["build", *(name for name, _ in models), "--output", "fmus", "--check", *options]) == 0
        told = capsys.readouterr()
        assert "all agree" in told.out
        assert told.err == ""


def test_what_the_page_about_own_models_says_may_not_be_written_is_refused(workplace: Path) -> None:
    page = (ROOT / "docs" / "own_model.md").read_text(encoding="utf-8")
    text = re.findall(r"<!-- model: thermal_spindle.py -->\n```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[0]
    for wrong in ("x = self.heat**2", "x = self.heat // 2.0", "x = self.heat % 2.0", "print(self.heat)",
                  "self.growth = 1", "NAN = 1.0"):
        (workplace / "wrong.py").write_text(text.replace("        rate = ", f"        {wrong}\n        rate = "))
        assert invoke(["build", "wrong.py"]) == 2, wrong


def links(page: Path) -> list[str]:
    return re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8"))


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in links(page):
            assert target.startswith("https://") or (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_page_is_linked_by_the_readme() -> None:
    linked = {(ROOT / target).resolve() for target in links(ROOT / "README.md")}
    assert set(PAGES[1:]) - linked == set()


def test_page_of_the_models_is_current() -> None:
    page = runpy.run_path(str(ROOT / "docs" / "write_models.py"))["page"]
    assert (ROOT / "docs" / "models.md").read_text(encoding="utf-8") == page(), "run python docs/write_models.py"


def test_page_of_the_units_is_current() -> None:
    page = runpy.run_path(str(ROOT / "docs" / "write_units.py"))["page"]
    assert (ROOT / "docs" / "units.md").read_text(encoding="utf-8") == page(), "run python docs/write_units.py"


def test_every_option_is_told(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    commands = [str(getattr(one.callback, "__name__", "")) for one in app.registered_commands]
    assert {"run", "analyze", "build", "cycle"} <= set(commands)
    lines = [[command] for command in commands]
    for group in app.registered_groups:
        assert group.typer_instance is not None
        lines += [[str(group.name), str(one.name or getattr(one.callback, "__name__", ""))]
                  for one in group.typer_instance.registered_commands]
    for command in lines:
        assert invoke([*command, "--help"]) == 0
        for option in set(re.findall(r"--[a-z][a-z-]+", capsys.readouterr().out)) - {"--help"}:
            assert option in OPTIONS, f"{command} {option}"
