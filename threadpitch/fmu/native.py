"""Native FMUs of FMI 2.0 and 3.0: the translated equations and the FMI wrapper as a library for each platform.

They need nothing but an FMI tool, and carry their sources, so that they can be compiled anywhere.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import threadpitch
from threadpitch.fmu.archive import write_archive
from threadpitch.fmu.compiler import Compiler, Platform, compile_library, compilers
from threadpitch.fmu.description import Flavor, guid, model_description
from threadpitch.fmu.description3 import build_description, model_description3, terminals_and_icons
from threadpitch.fmu.documentation import html_page, icon, upgrade_page
from threadpitch.fmu.failure import BuildError
from threadpitch.fmu.licenses import licenses, zig_licenses
from threadpitch.fmu.model import Model
from threadpitch.fmu.plain import plain_module
from threadpitch.fmu.reference import reference_entries
from threadpitch.fmu.table import Tokens, table
from threadpitch.fmu.translate import translate

WRAPPER = Path(__file__).with_name("c")
CARRIED = ("fmpy", "pyccel", "threadpitch")  # whose code is in such an FMU: FMI headers, translation, wrapper
VERSIONS = (2, 3)


@dataclass(frozen=True)
class NativeBuild:
    """Which FMI version, and the compiler of each platform."""

    fmi: int
    compilers: Mapping[Platform, Compiler]


def native_build(fmi: int, platforms: Sequence[Platform] | None) -> NativeBuild:
    """The build for these platforms; None stands for this machine.

    Raises:
        BuildError: a platform has no folder in this FMI version, or no compiler.
    """
    if fmi not in VERSIONS:
        raise BuildError(f"FMI {fmi!r} is not known; choose 2 or 3")
    for one in platforms or ():
        if fmi == 2 and one.folder2 is None:
            raise BuildError(f"FMI 2.0 has no folder for {one.name}; build it with --fmi 3")
    return NativeBuild(fmi, compilers(platforms))


def build_native_fmu(model: Model, folder: Path | str, build: NativeBuild) -> Path:
    """Build ``<ClassName>.fmu`` in the folder, FMI 3 in ``fmi3`` inside it; equal models give equal bytes.

    Raises:
        ModelError: the model leaves the subset, or does not translate (file, line, construct).
        BuildError: the compiler fails, or Pyccel or the FMI headers are missing.
        OSError: the folder or the cache cannot be written.
    """
    path = fmu_path(model, Path(folder), build.fmi)
    write_archive(path, _entries(model, build))
    return path


def fmu_path(model: Model, folder: Path, fmi: int) -> Path:
    """Where the FMU of this version lies: FMI 3 ones have a folder of their own."""
    return (folder / "fmi3" if fmi == 3 else folder) / f"{model.class_name}.fmu"


def wrapper_files(fmi: int) -> dict[str, bytes]:
    """The hand-written C of the FMI version, and the headers of the standard.

    Raises:
        BuildError: FMPy, which has the headers, is not complete.
    """
    other = f"fmi{5 - fmi}"
    files = {path.name: path.read_bytes() for path in WRAPPER.glob("*.[ch]") if not path.name.startswith(other)}
    folder = Path(str(importlib.metadata.distribution("fmpy").locate_file("fmpy"))) / "c-code"
    headers = {path.name: path.read_bytes() for path in folder.glob(f"fmi{fmi}*.h")}
    if not headers:
        raise BuildError(f"{folder} holds no FMI {fmi}.0 headers; install FMPy from its wheel: pip install fmpy")
    return files | headers


def _entries(model: Model, build: NativeBuild) -> dict[str, bytes]:
    sources, flavor = _sources(model, build.fmi)
    entries = {f"sources/{name}": content for name, content in sources.items()}
    for target, compiler in build.compilers.items():
        library = compile_library(model.class_name, sources, target, compiler)
        entries[f"binaries/{_folder(target, build.fmi)}/{model.class_name}{target.suffix}"] = library
    entries |= licenses(*CARRIED) | reference_entries(model) | {
        "documentation/index.html": html_page(model).encode(),
        "documentation/upgrade.html": upgrade_page(model).encode(),
    }
    by_zig = [target.name for target, compiler in build.compilers.items() if compiler.is_zig]
    if by_zig:
        entries |= zig_licenses(by_zig)
    if build.fmi == 2:
        return entries | {"modelDescription.xml": model_description(model, flavor), "model.png": icon(model)}
    return entries | {
        "modelDescription.xml": model_description3(model, flavor),
        "sources/buildDescription.xml": build_description(model, flavor.source_files),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(model),
        "terminalsAndIcons/icon.png": icon(model),
    }


def _sources(model: Model, fmi: int) -> tuple[dict[str, bytes], Flavor]:
    """All C files of the FMU, and the flavor whose GUID they hold."""
    equations = translate(model)
    files = wrapper_files(fmi) | {"equations.h": equations.header.encode(), "equations.c": equations.source.encode()}
    digest = hashlib.sha256(table(model, equations.class_name, Tokens("", "")).encode())
    for name in sorted(files):
        digest.update(name.encode() + b"\0" + files[name])
    tool = f"threadpitch {threadpitch.__version__} with Pyccel {importlib.metadata.version('pyccel')}"
    names = tuple(sorted(name for name in (*files, "model.c") if name.endswith(".c")))
    flavor = Flavor("native", tool, plain_module(model).name.rpartition("_")[2], needs_execution_tool=False,
                    content=digest.hexdigest(), source_files=names)
    token = guid(model, flavor)
    files["model.c"] = table(model, equations.class_name, Tokens(token, token)).encode()
    return files, flavor


def _folder(target: Platform, fmi: int) -> str:
    """The folder in ``binaries``; macOS on ARM is looked for in darwin64 by FMI 2 tools, as is Linux in linux64."""
    if fmi == 3:
        return target.name
    return target.folder2 or f"{target.name.partition('-')[2]}64"
