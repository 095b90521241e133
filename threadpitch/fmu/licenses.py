"""The licences of what an FMU carries, taken from the installed distributions."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Iterable
from pathlib import Path

_PROJECT_LICENSE = Path(__file__).parents[2] / "LICENSE"  # when run from the source tree


def license_text(distribution: str) -> bytes | None:
    """The licence text of an installed distribution, or of threadpitch's source tree; None when there is none."""
    try:
        files = importlib.metadata.files(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.stem.upper() in ("LICENSE", "LICENCE") and ".dist-info" in str(file):
            located = Path(str(file.locate()))
            if located.is_file():
                return located.read_bytes()
    if distribution == "threadpitch" and _PROJECT_LICENSE.is_file():
        return _PROJECT_LICENSE.read_bytes()
    return None


def licenses(*distributions: str) -> dict[str, bytes]:
    """``documentation/licenses/...`` entries of an FMU that carries code of these distributions."""
    found = {}
    for distribution in distributions:
        text = license_text(distribution)
        if text is not None:
            found[f"documentation/licenses/{distribution}-LICENSE.txt"] = text
    return found


def zig_licenses(platforms: Iterable[str]) -> dict[str, bytes]:
    """Licence texts of what zig links into the libraries for these platforms: compiler-rt, mingw-w64, glibc's start."""
    folder = Path(str(importlib.metadata.distribution("ziglang").locate_file("ziglang")))
    wanted = {"ziglang-LICENSE.txt": folder / "LICENSE"}
    for name in platforms:
        if name.endswith("-windows"):
            wanted["mingw-w64-COPYING.txt"] = folder / "lib" / "libc" / "mingw" / "COPYING"
        elif name.endswith("-linux"):
            wanted["glibc-LICENSES.txt"] = folder / "lib" / "libc" / "glibc" / "LICENSES"
    return {f"documentation/licenses/{name}": path.read_bytes() for name, path in wanted.items() if path.is_file()}
