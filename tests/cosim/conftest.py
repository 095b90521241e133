"""The C test FMUs (see probe/), built once per session, and packed with edited descriptions."""

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


def compiled(name: str, folder: Path) -> Path:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler")
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    with as_file(files("fmpy") / "c-code") as headers:
        subprocess.run([compiler, "-std=gnu99", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "-w", f"-I{headers}",
                        str(PROBE / f"{name}.c"), "-o", str(library), "-lm"], check=True)
    return library


def pack(path: Path, description: str, library: Path, platform: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("modelDescription.xml", description)
        packed.write(library, f"binaries/{platform}/{library.name}")
    return path


@pytest.fixture(scope="session")
def make_fmu(tmp_path_factory: pytest.TempPathFactory) -> FmuFactory:
    """make_fmu(path, edit) packs the probe of FMI 2.0 with an edited description."""
    library = compiled("probe", tmp_path_factory.mktemp("probe"))

    def make(path: Path, edit: Edit = lambda text: text) -> Path:
        return pack(path, edit((PROBE / "modelDescription.xml").read_text()), library, fmpy.platform)

    return make


@pytest.fixture(scope="session")
def make_fmu3(tmp_path_factory: pytest.TempPathFactory) -> FmuFactory:
    """make_fmu3(path, edit) packs the probe of FMI 3.0 with an edited description."""
    library = compiled("probe3", tmp_path_factory.mktemp("probe3"))

    def make(path: Path, edit: Edit = lambda text: text) -> Path:
        return pack(path, edit((PROBE / "modelDescription3.xml").read_text()), library, fmpy.platform_tuple)

    return make


@pytest.fixture(scope="session")
def probe_fmu(make_fmu: FmuFactory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_fmu(tmp_path_factory.mktemp("fmu") / "Probe.fmu")


@pytest.fixture(scope="session")
def probe3_fmu(make_fmu3: FmuFactory, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_fmu3(tmp_path_factory.mktemp("fmu3") / "Probe3.fmu")
