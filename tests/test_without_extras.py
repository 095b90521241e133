"""What is not in the extras works without them, and says their names where they are needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXTRAS = ("alembic", "asammdf", "asyncua", "bokeh", "dask", "dask_jobqueue", "distributed", "h5py", "jinja2",
          "matplotlib", "nptdms", "paho", "platformdirs", "psycopg", "pyarrow", "sqlalchemy", "starlette", "uvicorn")
SLOW = ("scipy.stats", "scipy.signal", "scipy.io", "scipy.integrate")
BARE = f"""
import importlib.machinery
import sys
found = importlib.machinery.PathFinder.find_spec
importlib.machinery.PathFinder.find_spec = staticmethod(
    lambda name, *more: None if name.partition(".")[0] in {EXTRAS} else found(name, *more))
from threadpitch.cli import invoke
status = invoke(sys.argv[1:])
print([name for name in {SLOW} if name in sys.modules])
sys.exit(status)
"""


def bare(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", BARE, *arguments], cwd=folder, capture_output=True, text=True,
                          check=False)


def test_a_thread_is_analysed_with_nothing_but_what_is_required(tmp_path: Path) -> None:
    turns = [k / 64.0 for k in range(640)]
    (tmp_path / "log.csv").write_text("angle,position\n" + "".join(f"{turn},{1.5 * turn}\n" for turn in turns))
    found = bare(tmp_path, "analyze", "log.csv", "--json")
    assert found.returncode == 0, found.stderr
    assert '"pitch_mm"' in found.stdout
    assert found.stdout.endswith("[]\n"), "loaded, which takes its time, without being used"


@pytest.mark.parametrize(("arguments", "extra"), [
    (("analyze", "log.csv", "--store", "runs.db"), "store"),
    (("store", "list", "--store", "runs.db"), "store"),
    (("report", "log.csv"), "report"),
    (("serve", "--store", "runs.db"), "serve"),
    (("study", str(ROOT / "models" / "studies" / "gain.toml")), "study"),
])
def test_what_needs_an_extra_says_its_name(tmp_path: Path, arguments: tuple[str, ...], extra: str) -> None:
    (tmp_path / "log.csv").write_text("angle,position\n" + "".join(f"{k / 64},{1.5 * k / 64}\n" for k in range(640)))
    found = bare(tmp_path, *arguments)
    assert found.returncode == 2, found.stderr
    assert found.stderr.count("\n") == 1, found.stderr
    assert f"threadpitch[{extra}]" in found.stderr
