"""FMUs from model files: PythonFMU or native, FMI 2.0 or 3.0, built when needed and kept by content."""

from __future__ import annotations

import functools
import hashlib
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import threadpitch
from threadpitch.fmu import native, python_fmu
from threadpitch.fmu.archive import is_whole
from threadpitch.fmu.cache import cache_folder
from threadpitch.fmu.compiler import platform_named
from threadpitch.fmu.documentation import icon
from threadpitch.fmu.failure import BuildError
from threadpitch.fmu.licenses import licenses
from threadpitch.fmu.model import Model, read_model

FLAVORS = ("python", "native")


@dataclass(frozen=True)
class _Builder:
    """A way of building: the function, and what the result depends on beside the model."""

    build: Callable[[Model, Path | str], Path]
    fmi: int
    key: tuple[str, ...]


def build_fmu(model_path: Path | str, folder: Path | str, flavor: str = "python", *, fmi: int = 2,
              platforms: Sequence[str] | None = None) -> Path:
    """Build the FMU of a model file; one of FMI 3 goes into ``fmi3`` inside the folder.

    ``platforms`` names those of a native FMU (``linux64``, ``win64``, ``darwin64``, or as FMI 3 does:
    ``aarch64-linux``); None stands for this machine.

    Raises:
        ModelError: the file is not a model, leaves the subset, or does not translate (file, line, construct).
        BuildError: flavor, version or platform are not known or do not fit, or what they need is missing.
        OSError: the folder cannot be written.
    """
    builder = _builder(flavor, fmi, platforms)
    return builder.build(read_model(model_path), folder)


def cached_fmu(model_path: Path | str, flavor: str = "python", *, fmi: int = 2,
               platforms: Sequence[str] | None = None) -> Path:
    """The FMU of a model file from the cache, built when it is not there; arguments as in ``build_fmu``.

    The folder's name is a hash of all that the FMU is made from, and the file appears in one move: two processes may
    build at once. A damaged file is built again. The cache is in the user's cache folder, or where
    ``THREADPITCH_CACHE`` says.

    Raises:
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    builder = _builder(flavor, fmi, platforms)
    model = read_model(model_path)
    folder = cache_folder() / "fmu" / _content_key(model, builder)
    path = native.fmu_path(model, folder, builder.fmi)
    return path if is_whole(path) else builder.build(model, folder)


def _builder(flavor: str, fmi: int, platforms: Sequence[str] | None) -> _Builder:
    if flavor not in FLAVORS:
        raise BuildError(f"flavor {flavor!r} is not known; choose one of {', '.join(FLAVORS)}")
    if flavor == "python":
        if fmi != 2:
            raise BuildError(f"PythonFMU makes FMUs of FMI 2.0, not {fmi}.0; use --flavor native for FMI 3.0")
        if platforms is not None:
            raise BuildError("a PythonFMU FMU holds the libraries that PythonFMU has; leave --platform out, "
                             "or use --flavor native")
        return _Builder(python_fmu.build_python_fmu, fmi, (flavor,))
    named = None if platforms is None else [platform_named(name) for name in dict.fromkeys(platforms)]
    build = native.native_build(fmi, named)
    compilers = (f"{target.name} {' '.join(one.command)} {one.version}" for target, one in build.compilers.items())
    return _Builder(lambda model, folder: native.build_native_fmu(model, folder, build), fmi,
                    (flavor, str(fmi), *sorted(compilers)))


def _content_key(model: Model, builder: _Builder) -> str:
    digest = hashlib.sha256(_builder_hash().encode())
    for part in (*builder.key, os.environ.get("SOURCE_DATE_EPOCH", ""), model.path.name, model.source):
        digest.update(part.encode() + b"\0")
    digest.update(icon(model))
    return digest.hexdigest()[:32]


@functools.cache
def _builder_hash() -> str:
    """Hash of what builds: this package, the table of units, what FMUs carry, and the Python that writes modules."""
    folder = Path(__file__).parent
    digest = hashlib.sha256(f"{threadpitch.__version__} {sys.version_info[:2]}".encode())
    for path in [*sorted(folder.glob("*.py")), folder.parent / "units.py"]:
        digest.update(path.read_bytes())
    carried = licenses(*sorted({*python_fmu.CARRIED, *native.CARRIED})) | python_fmu.pythonfmu_entries("Model")
    for fmi in native.VERSIONS:
        carried |= native.wrapper_files(fmi)
    for name, content in carried.items():
        digest.update(name.encode() + content)
    return digest.hexdigest()
