"""The fault library: named causes of a pitch fluctuation as parameter sets for the shipped lathe.

A fault is a file of ``models/faults``: what is wrong, the cause that a judgement should find, the signature that it
leaves in P(n), and parameters by component. Those of ``none.toml``, a lathe without faults, stand below every other.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from threadpitch.cosim.values import Given
from threadpitch.lathe import LatheError, shipped

NONE = "none"


class FaultError(LatheError):
    """There is no fault of this name; the message tells which there are."""


@dataclass(frozen=True)
class Fault:
    """One named cause. ``parameters`` maps ``component.variable`` to a value, SI or with a unit."""

    name: str
    description: str
    cause: str  # "control", "mechanical" or "none": what can be known from nominal and measured pitches
    signature: str
    parameters: Mapping[str, Given]
    stop_time: float | None = None  # s; None: that of the system


def fault_names() -> tuple[str, ...]:
    """The names of all faults, ``none`` among them."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def read_fault(name: str) -> Fault:
    """The fault of this name on a lathe that has no other.

    Raises:
        FaultError: there is none of this name.
    """
    known = fault_names()
    if name not in known:
        raise FaultError(f"no fault {name!r}; there are {', '.join(known)}")
    own, base = _document(name), _document(NONE)
    return Fault(name, own["description"], own["cause"], own["signature"], _parameters(base) | _parameters(own),
                 own.get("stop_time"))


def _folder() -> Path:
    return shipped("models") / "faults"


def _document(name: str) -> dict[str, Any]:
    return tomllib.loads((_folder() / f"{name}.toml").read_text(encoding="utf-8"))


def _parameters(document: Mapping[str, Any]) -> dict[str, Given]:
    return {f"{component}.{name}": value for component, values in document.get("parameters", {}).items()
            for name, value in values.items()}
