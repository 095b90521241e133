"""The Python of the page about the judgement runs as it stands."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import pytest

from threadpitch.cli import invoke

PAGE = Path(__file__).parents[2] / "docs" / "judgement.md"


def test_the_examples_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) == 4
    for number, block in enumerate(blocks):
        script = tmp_path / f"example_{number}.py"
        script.write_text(block, encoding="utf-8")
        runpy.run_path(str(script))
    printed = capsys.readouterr().out
    assert printed.startswith("both 0.98")
    assert "once per screw turn, amplitude" in printed
    assert "as expected (20.0 ms): raise Kv or the feedforward" in printed
    assert "verdict='conform'" in printed
    assert "it drops by 47.1 rpm at the entry" in printed


def test_the_commands_run(fmu_cache: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                          capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    for command in block.splitlines():
        assert invoke(shlex.split(command)[1:]) == 0, capsys.readouterr().err
        text = " ".join(capsys.readouterr().out.split())
        assert "Control: the fluctuation of" in text
        assert "as expected (20.0 ms)" in text
