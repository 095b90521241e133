"""Compiled functions are kept by what all sources beside them say, not by their own file alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

INNER = """
from threadpitch.compiled import compiled

@compiled()
def inner(x):
    return x + {shift}
"""
OUTER = """
import sys
sys.path.insert(0, sys.argv[1])
from inner import inner
from threadpitch.compiled import compiled

@compiled()
def outer(x):
    return 2 * inner(x)

print(outer(1), sum(outer.stats.cache_hits.values()))
"""


def test_a_change_beside_a_compiled_function_is_seen(tmp_path: Path) -> None:
    (tmp_path / "outer.py").write_text(OUTER)
    told = []
    for shift in (10, 10, 30):
        (tmp_path / "inner.py").write_text(INNER.format(shift=shift))
        command = [sys.executable, str(tmp_path / "outer.py"), str(tmp_path)]
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | {
            "PYTHONPATH": str(Path(__file__).parents[1])})
        told.append(done.stdout.split())
    assert told == [["22", "0"], ["22", "1"], ["62", "0"]]
