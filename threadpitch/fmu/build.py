"""FMUs from model files: PythonFMU FMUs of FMI 2.0, built when needed and kept by content.

The archive is put together here, not by ``pythonfmu.FmuBuilder``: that one imports the script into this process, writes
its own description (no units, random GUID, time of the build) and archives entries with the times of temporary files.
What it would pack is packed: PythonFMU's own package and its libraries, unchanged.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import os
import sys
from collections.abc import Callable
from pathlib import Path

import threadpitch
from threadpitch.fmu.archive import write_archive
from threadpitch.fmu.description import Flavor, model_description
from threadpitch.fmu.documentation import html_page, icon
from threadpitch.fmu.licenses import licenses
from threadpitch.fmu.model import Model, read_model
from threadpitch.fmu.plain import content_hash, plain_module
from threadpitch.fmu.script import adapter_script

_CARRIED = ("pythonfmu", "threadpitch")  # the distributions whose code is in an FMU
_LIBRARY_SUFFIXES = (".so", ".dll", ".dylib")


class BuildError(ValueError):
    """An FMU cannot be built: what is missing, and how to mend it."""


def build_python_fmu(model: Model, folder: Path | str) -> Path:
    """Build ``<ClassName>.fmu`` (FMI 2.0 co-simulation by PythonFMU) in the folder; equal models give equal bytes.

    Raises:
        ModelError: the model leaves the subset.
        BuildError: PythonFMU is not complete.
        OSError: the folder cannot be written.
    """
    path = Path(folder) / f"{model.class_name}.fmu"
    write_archive(path, _python_entries(model))
    return path


_FLAVORS: dict[str, Callable[[Model, Path | str], Path]] = {"python": build_python_fmu}


def build_fmu(model_path: Path | str, folder: Path | str, flavor: str = "python") -> Path:
    """Build the FMU of a model file in this flavor.

    Raises:
        ModelError: the file is not a model, or leaves the subset.
        BuildError: the flavor is not known, or what it needs is missing.
        OSError: the folder cannot be written.
    """
    return _builder(flavor)(read_model(model_path), folder)


def cached_fmu(model_path: Path | str, flavor: str = "python") -> Path:
    """The FMU of a model file from the cache, built when it is not there.

    The folder's name is a hash of all that the FMU is made from, and the file appears in one move: two processes may
    build at once. The cache is in the user's cache folder, or where ``THREADPITCH_CACHE`` says.

    Raises:
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    build = _builder(flavor)
    model = read_model(model_path)
    folder = cache_folder() / "fmu" / _content_key(model, flavor)
    path = folder / f"{model.class_name}.fmu"
    return path if path.is_file() else build(model, folder)


def cache_folder() -> Path:
    """``THREADPITCH_CACHE``, or the platform's folder for caches of this user."""
    chosen = os.environ.get("THREADPITCH_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "threadpitch" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "threadpitch"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "threadpitch"


def _builder(flavor: str) -> Callable[[Model, Path | str], Path]:
    if flavor not in _FLAVORS:
        raise BuildError(f"flavor {flavor!r} is not known; choose one of {', '.join(_FLAVORS)}")
    return _FLAVORS[flavor]


def _content_key(model: Model, flavor: str) -> str:
    digest = hashlib.sha256(_builder_hash().encode())
    for part in (flavor, os.environ.get("SOURCE_DATE_EPOCH", ""), model.path.name, model.source):
        digest.update(part.encode() + b"\0")
    digest.update(icon(model))
    return digest.hexdigest()[:32]


@functools.cache
def _builder_hash() -> str:
    """Hash of what builds: this package, the table of units, PythonFMU, and the Python that writes the modules."""
    folder = Path(__file__).parent
    digest = hashlib.sha256(f"{threadpitch.__version__} {sys.version_info[:2]}".encode())
    for path in [*sorted(folder.glob("*.py")), folder.parent / "units.py"]:
        digest.update(path.read_bytes())
    for name, content in (_pythonfmu_entries("Model") | licenses(*_CARRIED)).items():
        digest.update(name.encode() + content)
    return digest.hexdigest()


def _python_entries(model: Model) -> dict[str, bytes]:
    plain = plain_module(model)
    script = adapter_script(model, plain)
    entries = _pythonfmu_entries(model.class_name)
    content = content_hash(script.text + "".join(f"{name} {hashlib.sha256(entries[name]).hexdigest()}"
                                                 for name in sorted(entries)))
    tool = f"threadpitch {threadpitch.__version__} with PythonFMU {importlib.metadata.version('pythonfmu')}"
    flavor = Flavor("python", tool,
                    plain.name.rpartition("_")[2], needs_execution_tool=True, content=content)
    return entries | licenses(*_CARRIED) | {
        "modelDescription.xml": model_description(model, flavor),
        "model.png": icon(model),
        "documentation/index.html": html_page(model).encode(),
        "resources/slavemodule.txt": script.name.encode(),
        f"resources/{plain.name}.py": plain.text.encode(),
        f"resources/{script.name}.py": script.text.encode(),
    }


def _pythonfmu_folder() -> Path:
    # by its distribution, not by import: a loaded FMU has put its own copy, without libraries, first on sys.path
    try:
        return Path(str(importlib.metadata.distribution("pythonfmu").locate_file("pythonfmu")))
    except importlib.metadata.PackageNotFoundError as error:
        raise BuildError("PythonFMU is not installed; install it with: pip install pythonfmu==0.7.0") from error


def _pythonfmu_entries(model_identifier: str) -> dict[str, bytes]:
    """PythonFMU's package for ``resources/pythonfmu`` and its libraries for ``binaries/<platform>``."""
    folder = _pythonfmu_folder()
    entries = {f"resources/pythonfmu/{path.name}": path.read_bytes() for path in folder.glob("*.py")}
    libraries = [path for path in (folder / "resources" / "binaries").glob("*/*") if path.suffix in _LIBRARY_SUFFIXES]
    if not libraries:
        raise BuildError(f"{folder} holds no libraries; install PythonFMU from its wheel: pip install pythonfmu==0.7.0")
    for path in libraries:
        entries[f"binaries/{path.parent.name}/{model_identifier}{path.suffix}"] = path.read_bytes()
    return entries
