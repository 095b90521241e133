"""FMUs of several models, and a whole system packed as an .ssp with the FMUs that it names."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from threadpitch import cosim
from threadpitch.fmu import build_fmu
from threadpitch.fmu.archive import write_archive
from threadpitch.lathe import find_system, locate_fmu


def build_models(models: Iterable[Path], folder: Path, flavor: str) -> list[Path]:
    """Build the FMU of every model file into the folder.

    Raises:
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return [build_fmu(model, folder, flavor) for model in models]


def build_system(system: str | Path, folder: Path, flavor: str) -> Path:
    """Pack a system's folder, and the FMUs that its SSD names, as ``<folder name>.ssp``; equal input, equal bytes.

    Raises:
        cosim.CosimError: the system cannot be read, or an FMU is neither beside it nor a shipped model.
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    source = find_system(system)
    entries = {path.relative_to(source).as_posix(): path.read_bytes()
               for path in sorted(source.rglob("*")) if path.is_file() and not path.name.startswith(".")}

    def locate(name: str, base: Path) -> Path:
        path = locate_fmu(flavor, name, base)
        entries[name] = path.read_bytes()
        return path

    with cosim.read_system(source, locate=locate):
        target = folder / f"{source.name}.ssp"
        write_archive(target, entries)
    return target
