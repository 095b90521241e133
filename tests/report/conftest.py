"""What the tests of reports share: the folder of a run, and threads that are made by formulae."""

from __future__ import annotations

from pathlib import Path

import pytest

from threadpitch import lathe
from threadpitch.run_folder import save_run


@pytest.fixture(scope="session")
def run_folder(short_run: lathe.Simulation, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What ``threadpitch run`` leaves of the short run."""
    folder = tmp_path_factory.mktemp("report") / "short"
    save_run(short_run, folder)
    return folder
