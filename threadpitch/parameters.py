"""Parameters as people write them: files (.ssv, .toml, .json) and ``component.variable=value``."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeGuard

from threadpitch import cosim
from threadpitch.cosim.values import Given


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
        raise ParameterFileError(f"{path}: no such file; give an .ssv, .toml or .json")
    return readers[path.suffix.lower()](path)


def read_assignments(assignments: Sequence[str]) -> dict[str, Given]:
    """``["z_drive.screw_lead=10mm"]`` -> ``{"z_drive.screw_lead": "10mm"}``.

    Raises:
        ParameterFileError: there is no name or no value.
    """
    values: dict[str, Given] = {}
    for assignment in assignments:
        name, sign, value = assignment.partition("=")
        if not sign or "." not in name or not value.strip():
            raise ParameterFileError(f"{assignment!r} sets nothing; write it like z_drive.screw_lead=10mm")
        values[name.strip()] = value.strip()
    return values


def _read_ssv(path: Path) -> dict[str, Given]:
    values: dict[str, Given] = {}
    for entry in cosim.read_parameter_set(path):
        number = isinstance(entry.value, int | float) and not isinstance(entry.value, bool)
        values[entry.name] = f"{entry.value!r} {entry.unit}" if number and entry.unit else entry.value
    return values


def _read_toml(path: Path) -> dict[str, Given]:
    try:
        return dict(_flattened(path, tomllib.loads(path.read_text(encoding="utf-8"))))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterFileError(f"{path}: is not TOML: {error}") from None


def _read_json(path: Path) -> dict[str, Given]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise ParameterFileError(f"{path}: is not JSON: {error}") from None
    if not isinstance(document, dict):
        raise ParameterFileError(f"{path}: holds no object; write {{\"z_drive\": {{\"screw_lead\": \"10mm\"}}}}")
    return dict(_flattened(path, document))


def _flattened(path: Path, table: Mapping[str, object], owner: str = "") -> Iterator[tuple[str, Given]]:
    """``{"z_drive": {"screw_lead": 0.01}}`` and ``{"z_drive.screw_lead": 0.01}`` as pairs of name and value."""
    for key, value in table.items():
        name = owner + str(key)
        if isinstance(value, Mapping):
            yield from _flattened(path, value, f"{name}.")
        elif _is_value(value):
            yield name, value
        else:
            raise ParameterFileError(f"{path}: {name}: {value!r} is not a number, truth value, text or list of them")


def _is_value(value: object) -> TypeGuard[Given]:
    """A number, truth value or text, or a list of them."""
    many = value if isinstance(value, list) else [value]
    return all(isinstance(one, str | int | float) for one in many)
