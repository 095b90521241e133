"""Columns of a MATLAB file up to version 7: vectors, the columns of matrices, and the fields of structures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from threadpitch.trace.passes import Array

MOST_COLUMNS = 256  # of a matrix; what has more is no table of signals


class MatFile:
    """Which columns there are, by ``vector``, ``matrix/1``, ``structure/field``; they are read when they are asked for.

    Of a structure the fields are known only when it is read: it is, wholly.
    """

    def __init__(self, path: Path) -> None:
        from scipy.io import whosmat  # takes its time to load

        self._path = path
        self._matrices: dict[str, tuple[str, int]] = {}  # column: its matrix and its place in there, from 0
        self._fields: dict[str, Array] = {}
        self.names: list[str] = []
        for name, shape, kind in whosmat(path):
            if kind == "struct":
                found = _columns(_load(path, [name]))
                self._fields |= found
                self.names += found
            elif math.prod(shape) == max(shape, default=0) > 1:
                self.names.append(name)
            elif _is_table(shape) and kind not in ("cell", "char", "object", "sparse"):
                columns = {f"{name}/{k + 1}": (name, k) for k in range(shape[1])}
                self._matrices |= columns
                self.names += columns

    def read(self, wanted: Sequence[int]) -> list[Array]:
        """The columns at these places of ``names``."""
        chosen = [self.names[i] for i in wanted]
        variables = [self._matrices.get(name, (name, 0))[0] for name in chosen if name not in self._fields]
        loaded = _load(self._path, list(dict.fromkeys(variables))) if variables else {}
        return [self._column(name, loaded) for name in chosen]

    def _column(self, name: str, loaded: Mapping[str, Any]) -> Array:
        if name in self._fields:
            return self._fields[name]
        if name in self._matrices:
            matrix, place = self._matrices[name]
            return np.asarray(loaded[matrix])[:, place]
        return np.asarray(loaded[name]).ravel()


def _load(path: Path, variables: list[str]) -> dict[str, Any]:
    from scipy.io import loadmat

    found: dict[str, Any] = loadmat(path, variable_names=variables, simplify_cells=True)
    return {name: found[name] for name in variables}


def _is_table(shape: Sequence[int]) -> bool:
    return len(shape) == 2 and 1 < shape[1] <= min(MOST_COLUMNS, shape[0])


def _columns(structure: Mapping[str, Any]) -> dict[str, Array]:
    """The vectors in a structure, and in those inside it, by their path."""
    found: dict[str, Array] = {}
    for name, value in structure.items():
        if isinstance(value, dict):
            found |= {f"{name}/{inner}": column for inner, column in _columns(value).items()}
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "fiub":
            continue
        if array.ndim == 1 and array.size > 1:
            found[name] = array
        elif _is_table(array.shape):
            found |= {f"{name}/{k + 1}": array[:, k] for k in range(array.shape[1])}
    return found
