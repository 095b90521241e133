"""Components that run another FMU than the system's own: a user's .fmu, or a model file that is built first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from threadpitch import cosim
from threadpitch.fmu import cached_fmu


def replacements(given: Mapping[str, str | Path], flavor: str) -> dict[str, Path]:
    """Component -> FMU file, of component -> .fmu or model file (.py), which is built in this flavor.

    Raises:
        cosim.SystemStructureError: a file is neither.
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    return {component: _fmu(component, Path(path), flavor) for component, path in given.items()}


def read_replacements(texts: Sequence[str]) -> dict[str, Path]:
    """``["z_drive=my_drive.fmu"]`` -> ``{"z_drive": Path("my_drive.fmu")}``.

    Raises:
        cosim.SystemStructureError: there is no name or no file.
    """
    found: dict[str, Path] = {}
    for text in texts:
        component, sign, path = text.partition("=")
        if not sign or not component.strip() or not path.strip():
            raise cosim.SystemStructureError(f"{text!r} replaces nothing; write it like z_drive=my_drive.fmu")
        found[component.strip()] = Path(path.strip())
    return found


def _fmu(component: str, path: Path, flavor: str) -> Path:
    if path.suffix.lower() not in (".fmu", ".py"):
        raise cosim.SystemStructureError(f"component {component!r} cannot be replaced by {path}; give an .fmu, or a "
                                         "model file (.py), which is built")
    return cached_fmu(path, flavor) if path.suffix.lower() == ".py" else path
