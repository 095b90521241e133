"""Values in a study's file: numbers in SI, texts with a unit ("500rpm"), names of choices, truth values."""

from __future__ import annotations

import math
import re
from typing import TypeAlias

from threadpitch.studies.errors import StudyError
from threadpitch.units import UnitError, unit

Level: TypeAlias = float | str | bool  # a number in SI, the name of a choice, a truth value

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


def level(given: object, where: str) -> Level:
    """A value that a parameter takes; a text that begins with no number is the name of a choice.

    Raises:
        StudyError: it is no value.
    """
    if isinstance(given, str) and _QUANTITY.fullmatch(given) is None:
        return given
    return given if isinstance(given, bool) else number(given, where)


def number(given: object, where: str, *, difference: bool = False) -> float:
    """A finite number in SI; a ``difference`` (a width, a scale) takes no zero point of a unit (degC) with it.

    Raises:
        StudyError: it is none, or its unit is not known.
    """
    if isinstance(given, int | float) and not isinstance(given, bool):
        value = float(given)
    elif isinstance(given, str) and (match := _QUANTITY.fullmatch(given)) is not None:
        try:
            found = unit(match[2])
        except UnitError as error:
            raise StudyError(f"{where}: {given!r}: {error}") from None
        value = found.factor * float(match[1]) + (0.0 if difference else found.offset)
    else:
        raise StudyError(f"{where}: {given!r} is not a number; write it like 40 or \"10mm\"")
    if not math.isfinite(value):
        raise StudyError(f"{where}: {given!r} is not finite")
    return value
