"""Parameters as people write them: files (.ssv, .toml, .json) and ``component.variable=value``."""

from __future__ import annotations

import json
import reprlib
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeGuard, TypeVar

from threadpitch import cosim
from threadpitch.cosim.system import ParameterValue
from threadpitch.cosim.values import Given
from threadpitch.units import UNITS, compatible

_Value = TypeVar("_Value")
_DEEPEST = 20  # tables within tables; names of systems in systems have some
_LARGEST = 1000  # bits of an integer: a double holds it


class ParameterFileError(ValueError):
    """A parameter file or an assignment cannot be read: where, what, how to mend it."""


def read_parameters(path: str | Path) -> dict[str, Given]:
    """``component.variable`` -> value, from an .ssv, or from a .toml or .json with a table for each component.

    Numbers are SI; texts may carry a unit ("10mm"). In an .ssv a value has the unit that it states, else that of the
    variable.

    Raises:
        ParameterFileError: the file is missing, broken, of another kind, or holds what is no value.
        cosim.SystemStructureError: an .ssv breaks its schema.
    """
    path = Path(path)
    readers = {".ssv": _read_ssv, ".toml": _read_toml, ".json": _read_json}
    if path.suffix.lower() not in readers:
        raise ParameterFileError(f"{path}: is not a parameter file; give an .ssv, .toml or .json")
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "no such file"
        raise ParameterFileError(f"{path}: {what}; give an .ssv, .toml or .json")
    return readers[path.suffix.lower()](path)


def read_assignments(assignments: Sequence[str]) -> dict[str, Given]:
    """``["z_drive.screw_lead=10mm"]`` -> ``{"z_drive.screw_lead": "10mm"}``.

    Raises:
        ParameterFileError: there is no name or no value.
    """
    values: dict[str, Given] = {}
    for assignment in assignments:
        name, sign, value = assignment.partition("=")
        if not sign or not name.strip() or not value.strip():
            raise ParameterFileError(f"{assignment!r} sets nothing; write it like z_drive.screw_lead=10mm")
        values[name.strip()] = value.strip()
    return values


def _read_ssv(path: Path) -> dict[str, Given]:
    return _once(path, ((entry.name, _with_unit(entry)) for entry in cosim.read_parameter_set(path)))


def _with_unit(entry: ParameterValue) -> Given:
    """A number with its unit as a text; of a unit that the file itself defines, in the SI unit of the same kind."""
    if entry.unit is None or isinstance(entry.value, bool | str):
        return entry.value
    own = entry.definition
    if own is not None:
        for known in UNITS.values():
            if compatible(known, own) and (known.factor, known.offset) == (1.0, 0.0):
                return f"{own.factor * entry.value + own.offset!r} {known.name}"
    return f"{entry.value!r} {entry.unit}"


def _read_toml(path: Path) -> dict[str, Given]:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:  # wrong grammar, wrong characters, numbers of thousands of digits
        raise ParameterFileError(f"{path}: is not TOML: {error}") from None
    return _once(path, _flattened(path, document))


def _read_json(path: Path) -> dict[str, Given]:
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=lambda pairs: _once(path, pairs))
    except ParameterFileError:
        raise
    except (ValueError, RecursionError) as error:
        raise ParameterFileError(f"{path}: is not JSON: {error}") from None
    if not isinstance(document, dict):
        raise ParameterFileError(f"{path}: holds no object; write {{\"z_drive\": {{\"screw_lead\": \"10mm\"}}}}")
    return _once(path, _flattened(path, document))


def _once(path: Path, pairs: Iterable[tuple[str, _Value]]) -> dict[str, _Value]:
    """A dictionary of names that stand once: of two values one would be lost without a word."""
    found: dict[str, _Value] = {}
    for name, value in pairs:
        if name in found:
            raise ParameterFileError(f"{path}: {name!r} stands twice; keep one of them")
        found[name] = value
    return found


def _flattened(path: Path, table: Mapping[str, object], owner: str = "") -> Iterator[tuple[str, Given]]:
    """``{"z_drive": {"screw_lead": 0.01}}`` and ``{"z_drive.screw_lead": 0.01}`` as pairs of name and value."""
    for key, value in table.items():
        name = owner + str(key)
        if isinstance(value, Mapping):
            if name.count(".") > _DEEPEST:
                raise ParameterFileError(f"{path}: {name[:40]}... has more than {_DEEPEST} tables within tables; write "
                                         "component.variable")
            yield from _flattened(path, value, f"{name}.")
        elif _is_value(value):
            yield name, value
        else:
            raise ParameterFileError(f"{path}: {name}: {reprlib.repr(value)} is not a number, truth value, text or a "
                                     "list of them")


def _is_value(value: object) -> TypeGuard[Given]:
    """A number, truth value or text, or a list of them."""
    many = value if isinstance(value, list) else [value]
    return all(isinstance(one, str | float) or (isinstance(one, int) and one.bit_length() < _LARGEST) for one in many)
