"""FMUs built once for all tests of a process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fmu.driving import read
from threadpitch.fmu import build_python_fmu


@pytest.fixture(scope="session")
def python_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], Path]:
    """The PythonFMU FMU of a model file."""
    folder = tmp_path_factory.mktemp("fmus")
    built: dict[Path, Path] = {}

    def build(path: Path) -> Path:
        if path not in built:
            built[path] = build_python_fmu(read(path), folder)
        return built[path]

    return build
