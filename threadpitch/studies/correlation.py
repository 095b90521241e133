"""[[correlations]] of a study: correlations of the normal scores of pairs of parameters, as a matrix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.system import nearest
from threadpitch.studies.errors import StudyError
from threadpitch.studies.parameter import Parameter
from threadpitch.studies.quantity import number

_FORM = "correlations: write [[correlations]] with between = [\"a\", \"b\"] and value = 0.5"


def correlation_of(parameters: Sequence[Parameter], given: object) -> NDArray[np.float64] | None:
    """The matrix, (parameters, parameters); None where no correlations are given.

    Raises:
        StudyError: a pair is none, is given twice, or its value does not lie between -1 and 1.
    """
    if not given:
        return None
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise StudyError(_FORM)
    names = [one.name for one in parameters]
    matrix = np.eye(len(names))
    seen = set()
    for one in given:
        if not isinstance(one, Mapping) or set(one) != {"between", "value"}:
            raise StudyError(_FORM)
        first, second = _pair(one["between"], names)
        value = number(one["value"], "correlations")
        if not -1.0 < value < 1.0:
            raise StudyError(f"correlations: {value:g} does not lie between -1 and 1")
        if frozenset((first, second)) in seen:
            raise StudyError(f"correlations: {names[first]} and {names[second]} stand twice; take one of the values")
        seen.add(frozenset((first, second)))
        matrix[first, second] = matrix[second, first] = value
    return matrix


def _pair(between: object, names: Sequence[str]) -> tuple[int, int]:
    if not isinstance(between, list | tuple) or len(between) != 2 or not all(isinstance(one, str) for one in between):
        raise StudyError(_FORM)
    for name in between:
        if name not in names:
            raise StudyError(f"correlations: no parameter {name!r}{nearest(name, names)}")
    if between[0] == between[1]:
        raise StudyError(f"correlations: {between[0]} stands on both sides")
    return names.index(between[0]), names.index(between[1])
