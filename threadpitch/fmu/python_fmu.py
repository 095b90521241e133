"""FMUs of FMI 2.0 by PythonFMU: the plain module, the adapter and PythonFMU's libraries in one archive.

The archive is put together here, not by ``pythonfmu.FmuBuilder``: that one imports the script into this process, writes
its own description (no units, random GUID, time of the build) and archives entries with the times of temporary files.
What it would pack is packed: PythonFMU's own package and its libraries, unchanged.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from pathlib import Path

import threadpitch
from threadpitch.fmu.archive import write_archive
from threadpitch.fmu.description import Flavor, model_description
from threadpitch.fmu.documentation import html_page, icon, upgrade_page
from threadpitch.fmu.failure import BuildError
from threadpitch.fmu.licenses import licenses
from threadpitch.fmu.model import Model
from threadpitch.fmu.plain import content_hash, plain_module
from threadpitch.fmu.reference import reference_entries
from threadpitch.fmu.script import adapter_script

CARRIED = ("pythonfmu", "threadpitch")  # the distributions whose code is in such an FMU
_LIBRARY_SUFFIXES = (".so", ".dll", ".dylib")


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


def pythonfmu_entries(model_identifier: str) -> dict[str, bytes]:
    """PythonFMU's package for ``resources/pythonfmu`` and its libraries for ``binaries/<platform>``.

    Raises:
        BuildError: PythonFMU is not installed, or without its libraries.
    """
    folder = _pythonfmu_folder()
    entries = {f"resources/pythonfmu/{path.name}": path.read_bytes() for path in folder.glob("*.py")}
    libraries = [path for path in (folder / "resources" / "binaries").glob("*/*") if path.suffix in _LIBRARY_SUFFIXES]
    if not libraries:
        raise BuildError(f"{folder} holds no libraries; install PythonFMU from its wheel: pip install pythonfmu==0.7.0")
    for path in libraries:
        entries[f"binaries/{path.parent.name}/{model_identifier}{path.suffix}"] = path.read_bytes()
    return entries


def _python_entries(model: Model) -> dict[str, bytes]:
    plain = plain_module(model)
    script = adapter_script(model, plain)
    entries = pythonfmu_entries(model.class_name)
    content = content_hash(script.text + "".join(f"{name} {hashlib.sha256(entries[name]).hexdigest()}"
                                                 for name in sorted(entries)))
    tool = f"threadpitch {threadpitch.__version__} with PythonFMU {importlib.metadata.version('pythonfmu')}"
    flavor = Flavor("python", tool,
                    plain.name.rpartition("_")[2], needs_execution_tool=True, content=content)
    return entries | licenses(*CARRIED) | reference_entries(model) | {
        "modelDescription.xml": model_description(model, flavor),
        "model.png": icon(model),
        "documentation/index.html": html_page(model).encode(),
        "documentation/upgrade.html": upgrade_page(model).encode(),
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
