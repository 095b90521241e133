"""One parameter of a study: the values that it takes, or the distribution that it has."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded when they are used
from numpy.typing import NDArray

from threadpitch.cosim.system import nearest
from threadpitch.studies.errors import StudyError
from threadpitch.studies.quantity import Level, common_unit, level, number

FloatArray = NDArray[np.float64]

LEVELS = 5  # of a distribution in a grid
MOST_LEVELS = 1_000_000
_RANGE = {"from", "to", "count", "log"}


@dataclass(frozen=True)
class Parameter:
    """``values`` in SI, names or truth values; or a frozen distribution of ``scipy.stats``, with its ``levels``.

    ``unit`` is the one that they are written with in the study.
    """

    name: str
    values: tuple[Level, ...] = ()
    law: Any = None
    count: int = LEVELS
    unit: str | None = None

    @property
    def drawn(self) -> bool:
        """Whether it has a distribution."""
        return self.law is not None

    @property
    def levels(self) -> tuple[Level, ...]:
        """What a grid takes: the values, or the middles of ``count`` parts of the distribution of equal probability."""
        return self.values or tuple(self.at((np.arange(self.count) + 0.5) / self.count))

    @property
    def middle(self) -> Level:
        """What it is while others are varied: the median of the distribution, or the middle one of the values."""
        return self.levels[(len(self.levels) - 1) // 2] if self.values else self.at(np.array([0.5]))[0]

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest number, of a uniform distribution or of values.

        Raises:
            StudyError: it has no finite bounds, or takes names.
        """
        if self.drawn:
            low, high = (float(bound) for bound in self.law.support())
        elif all(isinstance(value, float) for value in self.values):
            low, high = (float(bound) for bound in (min(self.values), max(self.values)))
        else:
            low, high = math.nan, math.nan
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise StudyError(f"parameter {self.name}: has no bounds; write {{ from = 30, to = 80 }}")
        return low, high

    def at(self, share: FloatArray) -> list[Level]:
        """Inverse distribution function at ``share`` (n,) between 0 and 1; values are taken as equally likely."""
        if self.drawn:
            return [float(value) for value in self.law.ppf(share)]
        places = np.minimum((share * len(self.values)).astype(int), len(self.values) - 1)
        return [self.values[place] for place in places]


def read_parameter(name: str, given: object) -> Parameter:
    """A parameter out of a study's file: a list, { from, to, count, log }, or { distribution, ... }.

    Raises:
        StudyError: it is none of them.
    """
    where = f"parameter {name}"
    if isinstance(given, Sequence) and not isinstance(given, str):
        return _listed(name, given)
    if isinstance(given, Mapping):
        if set(given) == {"values"}:
            return _listed(name, given["values"])
        if "distribution" in given:
            return _distributed(name, given)
        if {"from", "to"} <= set(given) <= _RANGE:
            return _ranged(name, given)
    raise StudyError(f"{where}: write a list of values, {{ from, to, count }} or {{ distribution, ... }}")


def _listed(name: str, given: Sequence[object]) -> Parameter:
    values = tuple(level(value, f"parameter {name}") for value in given)
    if not values or len(set(values)) < len(values):
        raise StudyError(f"parameter {name}: has {'one of its values twice' if values else 'no values'}")
    if len({type(value) for value in values}) > 1:
        raise StudyError(f"parameter {name}: mixes numbers, texts and truth values; take one kind")
    return Parameter(name, values, unit=common_unit(given, f"parameter {name}"))


def _ranged(name: str, given: Mapping[str, Any]) -> Parameter:
    """From one number to another: with a count equally spaced values, without one a uniform distribution."""
    low, high = (number(given[word], f"parameter {name}: {word}") for word in ("from", "to"))
    log, count = given.get("log", False), given.get("count")
    written = common_unit((given["from"], given["to"]), f"parameter {name}")
    if not isinstance(log, bool):
        raise StudyError(f"parameter {name}: log: {log!r} is neither true nor false")
    if not low < high or (log and low <= 0.0):
        raise StudyError(f"parameter {name}: 'from' must be {'positive and ' if log else ''}less than 'to'")
    if count is not None:
        _check_count(name, count)
        values = np.geomspace(low, high, count) if log else np.linspace(low, high, count)
        return Parameter(name, tuple(float(value) for value in values), unit=written)
    law = scipy.stats.loguniform(low, high) if log else scipy.stats.uniform(low, high - low)
    return Parameter(name, law=law, unit=written)


def _distributed(name: str, given: Mapping[str, Any]) -> Parameter:
    word = given["distribution"]
    kinds = scipy.stats.rv_continuous | scipy.stats.rv_discrete
    families = [one for one in dir(scipy.stats) if isinstance(getattr(scipy.stats, one), kinds)]
    if word not in families:
        raise StudyError(f"parameter {name}: no distribution {word!r} in scipy.stats{nearest(str(word), families)}")
    count = given.get("levels", LEVELS)
    _check_count(name, count)
    family = getattr(scipy.stats, word)
    shapes = [one.strip() for one in (family.shapes or "").split(",") if one.strip()]
    wanted = set(given) - {"distribution", "levels"}
    known = [*shapes, "loc", *(["scale"] if isinstance(family, scipy.stats.rv_continuous) else [])]
    for unknown in sorted(wanted - set(known)):
        raise StudyError(f"parameter {name}: {word} has no {unknown!r}; it takes {', '.join(known)}")
    for missing in (shape for shape in shapes if shape not in wanted):
        raise StudyError(f"parameter {name}: {word} needs {missing!r}; it takes {', '.join(known)}")
    values = {one: number(given[one], f"parameter {name}: {one}", difference=one != "loc") for one in wanted}
    law = family(**values)
    if not (math.isfinite(law.ppf(0.5)) and math.isfinite(law.ppf(0.001))):
        raise StudyError(f"parameter {name}: {word} does not exist with {values}; see scipy.stats.{word}")
    written = common_unit((given[one] for one in ("loc", "scale") if one in given), f"parameter {name}")
    return Parameter(name, law=law, count=count, unit=written)


def _check_count(name: str, count: object) -> None:
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= MOST_LEVELS:
        raise StudyError(f"parameter {name}: {count!r} is no number of levels; give 2 to {MOST_LEVELS:,}")
