"""From a model description to its scalars: bounds, units, choices, and the elements of arrays."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from threadpitch.cosim.document import Element
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.variable import FmuVariable

MOST_ELEMENTS = 10**6  # of one array and of all variables: each is a variable of its own here
_TRUTH = {"true": 1.0, "false": 0.0}


class VariablesError(CosimError):
    """A variable of an FMU is not described as the standard says."""


@dataclass(frozen=True)
class _Extras:
    """What FMPy leaves out, by variable: named values of Integers, and what intermediate updates can set."""

    choices: Mapping[str, Mapping[str, int]]
    followed: frozenset[str]


def read_variables(description: Any, root: Element) -> Iterator[FmuVariable]:
    """All scalars of FMPy's ``ModelDescription``; ``root`` is the same document.

    Raises:
        VariablesError: an array has no size, or one that nobody means.
    """
    extras = _Extras(_choices(root), _followed(root))
    fmi = int(str(description.fmiVersion)[0])
    interpolates = fmi == 2 and description.coSimulation.canInterpolateInputs
    count = 0
    for found in description.modelVariables:
        one = _variable(found, extras, fmi)
        if interpolates and one.causality == "input" and one.type == "Real":
            one = _with(one, interpolated=True)
        for element in _elements(one, found):
            count += 1
            if count > MOST_ELEMENTS:
                raise VariablesError(f"more than {MOST_ELEMENTS} variables, of which {one.name} is one; refused")
            yield element


def to_number(text: str | None) -> float | None:
    """The number that an attribute states; None where it states none, or NaN."""
    if text is None:
        return None
    value = float(text)
    return None if math.isnan(value) else value


def _variable(found: Any, extras: _Extras, fmi: int) -> FmuVariable:
    declared = found.declaredType
    choices: Mapping[str, int] | None = extras.choices.get(found.name)
    if found.type == "Enumeration" and declared is not None:
        choices = {item.name: int(item.value) for item in declared.items}
    return FmuVariable(
        name=found.name,
        reference=found.valueReference,
        type=found.type,
        causality=found.causality,
        unit=found.unit or getattr(declared, "unit", None),
        display=found.displayUnit or getattr(declared, "displayUnit", None),
        minimum=to_number(found.min if found.min is not None else getattr(declared, "min", None)),
        maximum=to_number(found.max if found.max is not None else getattr(declared, "max", None)),
        choices=choices,
        settable=found.variability != "constant" and found.causality != "structuralParameter" and (
            found.causality == "input" or found.initial in ("exact", "approx")),
        fmi=fmi,
        interpolated=found.name in extras.followed,
        discrete=found.variability == "discrete",
    )


def _elements(one: FmuVariable, found: Any) -> Iterator[FmuVariable]:
    """The variable itself, or the elements of an array, row by row."""
    starts = _starts(one, found.start)
    if not found.dimensions:
        yield _with(one, start=starts[0] if starts else None)
        return
    size = math.prod(found.shape)
    if not 0 <= size <= MOST_ELEMENTS:
        raise VariablesError(f"variable {one.name}: an array of {size} elements; at most {MOST_ELEMENTS} can be read")
    if size == 0:  # the other extents may be of any size
        return
    for element, index in enumerate(itertools.product(*(range(1, extent + 1) for extent in found.shape))):
        start = None if not starts else starts[0] if len(starts) == 1 else starts[min(element, len(starts) - 1)]
        yield _with(one, name=f"{one.name}[{','.join(map(str, index))}]", element=element, size=size, start=start)


def _starts(one: FmuVariable, text: str | None) -> list[float]:
    if text is None or not one.exchanged:
        return []
    return [_TRUTH[word] if word in _TRUTH else float(word) for word in text.split()]


def _with(one: FmuVariable, **changes: Any) -> FmuVariable:
    return FmuVariable(**(vars(one) | changes))


def _choices(root: Element) -> dict[str, dict[str, int]]:
    """By variable: the names and numbers that our own annotation gives, in the form of FMI 2.0 or 3.0."""
    choices: dict[str, dict[str, int]] = {}
    for variable in root.iterfind("ModelVariables/*"):
        for path in ("Tool[@name='threadpitch']/Choices/Choice", "Annotation[@type='threadpitch.choices']/Choice"):
            for choice in variable.iterfind(f"Annotations/{path}"):
                with contextlib.suppress(ValueError):  # somebody else's annotation: without meaning for us
                    named = choices.setdefault(variable.get("name", ""), {})
                    named[choice.get("name", "")] = int(choice.get("value", ""))
    return choices


def _followed(root: Element) -> frozenset[str]:
    """The inputs that an FMU of FMI 3.0 lets be set in its intermediate updates (FMI 3.0.2, 2.4.7.4)."""
    slave = root.find("CoSimulation")
    if slave is None or slave.get("providesIntermediateUpdate") not in ("true", "1"):
        return frozenset()
    return frozenset(
        variable.get("name", "") for variable in root.iterfind("ModelVariables/Float64")
        if variable.get("causality") == "input" and variable.get("intermediateUpdate") in ("true", "1"))
