"""The types of values that FMUs exchange, by the names of the standards' C types, and how they lie in the memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class CType:
    """One C type: ``fmi2Real``, ``fmi3Int64``; its functions are ``fmi2GetReal``, ``fmi3SetInt64`` and so on.

    ``family`` tells what may be connected: "Real", "Integer" or "Boolean" values of any width and FMI version.
    """

    name: str
    family: str
    dtype: np.dtype[Any]

    @property
    def getter(self) -> str:
        """The FMI function that gets values of this type."""
        return f"{self.name[:4]}Get{self.name[4:]}"

    @property
    def setter(self) -> str:
        """The FMI function that sets values of this type."""
        return f"{self.name[:4]}Set{self.name[4:]}"


_WHOLE = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
C_TYPES = {one.name: one for one in (
    CType("fmi2Real", "Real", np.dtype(np.float64)),
    CType("fmi2Integer", "Integer", np.dtype(np.int32)),
    CType("fmi2Boolean", "Boolean", np.dtype(np.int32)),
    CType("fmi3Float64", "Real", np.dtype(np.float64)),
    CType("fmi3Float32", "Real", np.dtype(np.float32)),
    *(CType(f"fmi3{name}", "Integer", np.dtype(name.lower())) for name in _WHOLE),
    CType("fmi3Boolean", "Boolean", np.dtype(np.bool_)),
)}

_FAMILIES = {"Float32": "Real", "Float64": "Real"} | dict.fromkeys(_WHOLE, "Integer")


def c_type_name(fmi: int, type_: str) -> str:
    """The C type of a variable; ``type_`` is its word in modelDescription.xml, of FMI version 2 or 3."""
    carried = {2: "Integer", 3: "Int64"}[fmi] if type_ == "Enumeration" else type_
    return f"fmi{fmi}{carried}"


def family_of(type_: str) -> str:
    """Real, Integer, Boolean, Enumeration, String, Binary or Clock: the type without its width."""
    return _FAMILIES.get(type_, type_)
