"""Parameter sets (SSV) and parameter mappings (SSM)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from threadpitch.cosim.document import Element
from threadpitch.cosim.ssp.content import TRUE, Definitions, shape, transformation, type_name, typed
from threadpitch.cosim.ssp.schema import SSM, SSV, where
from threadpitch.cosim.system import ParameterValue, SystemStructureError, Transformation, Value

_REALS = ("Real", "Float64", "Float32")
_TEXTS = ("String", "Enumeration", "Binary")


@dataclass(frozen=True)
class Mapping:
    """``target = transformation(source)``: which parameter of a set goes where."""

    source: str
    target: str
    transformation: Transformation


def parameter_values(root: Element, name: str, enclosing: Definitions) -> tuple[ParameterValue, ...]:
    """The values of a parameter set, in its order; of an array its elements ``name[1]``, ``name[2]``, ...

    Raises:
        SystemStructureError: a parameter is binary, or states another number of values than its extents say.
    """
    definitions = Definitions.of(root, SSV).within(enclosing)
    return tuple(value for parameter in root.iterfind(f"{SSV}Parameters/{SSV}Parameter")
                 for value in _values(parameter, where(name, parameter), definitions))


def mappings(root: Element) -> tuple[Mapping, ...]:
    """The entries of a parameter mapping."""
    return tuple(Mapping(entry.get("source", ""), entry.get("target", ""), transformation(entry))
                 for entry in root.iterfind(f"{SSM}MappingEntry"))


def mapped(values: Sequence[ParameterValue], entries: Sequence[Mapping]) -> Iterator[ParameterValue]:
    """The values under the names that they are mapped to; what no entry names is not applied (SSP 1.0, 5.5)."""
    for entry in entries:
        for value in values:
            name, bracket, indices = value.name.partition("[")
            if value.name == entry.source:
                yield replace(value, name=entry.target, transformation=entry.transformation)
            elif bracket and name == entry.source:
                yield replace(value, name=f"{entry.target}[{indices}", transformation=entry.transformation)


def _values(parameter: Element, origin: str, definitions: Definitions) -> Iterator[ParameterValue]:
    name, kind = parameter.get("name", ""), typed(parameter, SSV)
    if kind is None or type_name(kind) in ("Binary", "Clock"):
        raise SystemStructureError(f"{origin}: parameter {name!r} is neither a number, a truth value nor a text")
    read = _reader(type_name(kind))
    unit = _unbracketed(kind.get("unit"), definitions)
    common = ParameterValue(name, "", unit, origin, definitions.units.get(unit or ""),
                            choices=definitions.enumerations.get(kind.get("name", "")))
    extents = shape(parameter)
    texts = _texts(kind)
    if not extents and len(texts) == 1:
        yield replace(common, value=read(texts[0]))
        return
    sizes = [extent or 0 for extent in extents] or [len(texts)]
    if math.prod(sizes) != len(texts):
        raise SystemStructureError(f"{origin}: parameter {name!r} holds {len(texts)} values for an array of "
                                   f"{' x '.join(map(str, sizes))}")
    indices = itertools.product(*(range(1, size + 1) for size in sizes)) if texts else ()
    for index, text in zip(indices, texts, strict=True):
        yield replace(common, name=f"{name}[{','.join(map(str, index))}]", value=read(text))


def _unbracketed(unit: str | None, definitions: Definitions) -> str | None:
    """``m`` of ``[m]``, as some tools write units, unless the file defines a unit of that name."""
    bracketed = unit is not None and unit not in definitions.units and unit[:1] + unit[-1:] == "[]"
    return unit[1:-1] if unit is not None and bracketed else unit


def _texts(kind: Element) -> list[str]:
    """The values of a parameter as they are written; texts of an array stand in elements of their own (SSP 2.0)."""
    if type_name(kind) in _TEXTS:
        elements = kind.findall(f"{SSV}Value")
        return [found.get("value", "") for found in elements] or [kind.get("value", "")]
    return kind.get("value", "").split()


def _reader(kind: str) -> Callable[[str], Value]:
    if kind in _REALS:
        return float
    if kind in _TEXTS:
        return str
    return _truth if kind == "Boolean" else int


def _truth(text: str) -> bool:
    return text in TRUE
