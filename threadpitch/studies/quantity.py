"""Values in a study's file: numbers in SI, texts with a unit ("500rpm"), names of choices, truth values."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import TypeAlias

from threadpitch.studies.errors import StudyError
from threadpitch.units import UnitError, compatible, unit

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


def written_unit(given: object) -> str | None:
    """The unit that a quantity is written with, which ``number`` knows; None for numbers and names."""
    match = _QUANTITY.fullmatch(given) if isinstance(given, str) else None
    return unit(match[2]).name if match is not None and match[2] else None


def common_unit(given: Iterable[object], where: str) -> str | None:
    """The first unit that quantities are written with; None where there is none.

    Raises:
        StudyError: they measure different things.
    """
    found = [one for one in map(written_unit, given) if one is not None]
    for one in found[1:]:
        if not compatible(unit(one), unit(found[0])):
            raise StudyError(f"{where}: mixes {found[0]!r} and {one!r}; take units of one kind")
    return found[0] if found else None


def number(given: object, where: str, *, difference: bool = False, measures: str | None = None) -> float:
    """A finite number in SI; a ``difference`` (a width, a scale) takes no zero point of a unit (degC) with it.

    Raises:
        StudyError: it is none, or its unit is not known or does not measure what the unit ``measures`` does.
    """
    if isinstance(given, int | float) and not isinstance(given, bool):
        value = float(given)
    elif isinstance(given, str) and (match := _QUANTITY.fullmatch(given)) is not None:
        try:
            found = unit(match[2])
        except UnitError as error:
            raise StudyError(f"{where}: {given!r}: {error}") from None
        if measures is not None and match[2] and not compatible(found, unit(measures)):
            raise StudyError(f"{where}: {given!r} does not fit; it has a unit like {measures}")
        value = found.factor * float(match[1]) + (0.0 if difference else found.offset)
    else:
        raise StudyError(f"{where}: {given!r} is not a number; write it like 40 or \"10mm\"")
    if not math.isfinite(value):
        raise StudyError(f"{where}: {given!r} is not finite")
    return value
