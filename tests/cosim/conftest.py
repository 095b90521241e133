"""The C test FMU (see probe/probe.c), built once per session, and systems made of it."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path

import fmpy
import pytest

PROBE = Path(__file__).parent / "probe"
Edit = Callable[[str], str]
FmuFactory = Callable[..., Path]


@pytest.fixture(scope="session")
def probe_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = tmp_path_factory.mktemp("probe") / f"probe{fmpy.sharedLibraryExtension}"
    with as_file(files("fmpy") / "c-code") as headers:
        subprocess.run([compiler, "-std=gnu99", "-O1", "-fPIC", "-shared", "-w", f"-I{headers}", str(PROBE / "probe.c"),
                        "-o", str(library), "-lm"], check=True)
    return library


@pytest.fixture(scope="session")
def make_fmu(probe_library: Path) -> FmuFactory:
    """make_fmu(path, edit) packs the probe with an edited description."""

    def make(path: Path, edit: Edit = lambda text: text) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path, "w") as packed:
            packed.writestr("modelDescription.xml", edit((PROBE / "modelDescription.xml").read_text()))
            packed.write(probe_library, f"binaries/{fmpy.platform}/{probe_library.name}")
        return path

    return make


@pytest.fixture(scope="session")
def probe_fmu(make_fmu: FmuFactory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_fmu(tmp_path_factory.mktemp("fmu") / "Probe.fmu")
