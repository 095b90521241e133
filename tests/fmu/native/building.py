"""Native FMUs for the tests: built once for all workers, compiled by whatever this machine has."""

from __future__ import annotations

import functools
import os
import tempfile
from pathlib import Path

import pytest

from tests.fmu.driving import MODEL_PATHS, names
from threadpitch.fmu import available_compiler, cached_fmu

every_model = pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
both_versions = pytest.mark.parametrize("fmi", [2, 3], ids=["fmi2", "fmi3"])
needs_compiler = pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang")


@functools.cache
def built(path: Path, fmi: int = 2) -> Path:
    """The native FMU of a model file for this machine."""
    return cached_fmu(path, "native", fmi=fmi)


@functools.cache
def zig_folder() -> Path:
    """One cache of zig for all test runs: its first library for Windows takes minutes, all others a second."""
    chosen = os.environ.get("ZIG_GLOBAL_CACHE_DIR")
    return Path(chosen) if chosen else Path(tempfile.gettempdir()) / "threadpitch-test-zig"
