"""The licences of what an FMU carries, taken from the installed distributions."""

from __future__ import annotations

import importlib.metadata
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
