"""The Python of the page about the judgement runs as it stands."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "judgement.md"


def test_the_examples_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert len(blocks) == 3
    for number, block in enumerate(blocks):
        script = tmp_path / f"example_{number}.py"
        script.write_text(block, encoding="utf-8")
        runpy.run_path(str(script))
    printed = capsys.readouterr().out
    assert printed.startswith("both 0.98")
    assert "once per screw turn, amplitude" in printed
    assert "as expected (20.0 ms): raise Kv or the feedforward" in printed
    assert "verdict='conform'" in printed
