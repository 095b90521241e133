"""What all files of SSP share: units, enumerations, types, connectors, transformations, annotations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lxml import etree

from threadpitch.cosim.document import Element
from threadpitch.cosim.ssp.schema import SSC, SSD, inside
from threadpitch.cosim.system import Annotation, Connector, Table, Transformation
from threadpitch.units import BASES, Unit

TYPES = ("Real", "Float64", "Float32", "Integer", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
         "UInt64", "Boolean", "String", "Enumeration", "Binary", "Clock")
TRUE = ("true", "1")
_OWNERS = (f"{SSD}System", f"{SSD}Component", f"{SSD}SignalDictionaryReference", f"{SSD}Connector")


@dataclass(frozen=True)
class Definitions:
    """The units and enumerations that one file defines."""

    units: Mapping[str, Unit]
    enumerations: Mapping[str, Mapping[str, int]]

    @classmethod
    def of(cls, root: Element, namespace: str) -> Definitions:
        """Those of a file whose own elements live in ``namespace``."""
        units = {unit.name: unit for unit in map(_unit, root.iterfind(f"{namespace}Units/{SSC}Unit"))}
        enumerations = {
            found.get("name", ""): {item.get("name", ""): int(item.get("value", "0"))
                                    for item in found.iterfind(f"{SSC}Item")}
            for found in root.iterfind(f"{namespace}Enumerations/{SSC}Enumeration")}
        return cls(units, enumerations)

    def within(self, enclosing: Definitions) -> Definitions:
        """These, and those of the enclosing file that they do not replace."""
        return Definitions({**enclosing.units, **self.units}, {**enclosing.enumerations, **self.enumerations})


def typed(element: Element, namespace: str) -> Element | None:
    """The child that tells the type of a connector, a dictionary entry or a parameter."""
    return next((child for kind in TYPES for child in element.iterfind(namespace + kind)), None)


def type_name(kind: Element) -> str:
    """``Real`` of an element ``<ssc:Real>``."""
    return str(etree.QName(kind).localname)


def shape(element: Element) -> tuple[int | None, ...]:
    """The extents of an array, None where one depends on another connector; () of a scalar."""
    return tuple(None if one.get("size") is None else int(one.get("size", ""))
                 for one in element.iterfind(f"{SSC}Dimension"))


def connector(element: Element, definitions: Definitions) -> Connector:
    """A connector, or an entry of a signal dictionary, whose kind is "inout"."""
    name, kind, extents = element.get("name", ""), element.get("kind", "inout"), shape(element)
    found = typed(element, SSC)
    if found is None:
        return Connector(name, kind, shape=extents)
    unit = found.get("unit")
    return Connector(name, kind, type_name(found), unit, extents, definitions.units.get(unit or ""),
                     definitions.enumerations.get(found.get("name", "")))


def connectors(element: Element, definitions: Definitions) -> tuple[Connector, ...]:
    """All connectors of a component or a system."""
    return tuple(connector(found, definitions) for found in element.iterfind(f"{SSD}Connectors/{SSD}Connector"))


def transformation(element: Element) -> Transformation:
    """That of a connection or of an entry of a parameter mapping."""
    convert = element.get("suppressUnitConversion", "false").strip() not in TRUE
    linear = element.find(f"{SSC}LinearTransformation")
    if linear is not None:
        return Transformation(float(linear.get("factor", 1.0)), float(linear.get("offset", 0.0)), convert)
    for kind in ("Boolean", "Integer", "Enumeration"):
        found = element.find(f"{SSC}{kind}MappingTransformation")
        if found is not None:
            pairs = ((entry.get("source", ""), entry.get("target", "")) for entry in found.iterfind(f"{SSC}MapEntry"))
            return Transformation(convert_units=convert, table=Table(kind, tuple(pairs)))
    return Transformation(convert_units=convert)


def annotated(root: Element, prefix: str) -> Iterator[Annotation]:
    """All annotations of an SSD, with the names of what they belong to in the flat system."""
    for found in root.iter(f"{SSC}Annotation"):
        above = [one for one in found.iterancestors() if one.tag in _OWNERS][::-1]
        names = [prefix.rstrip("."), *(one.get("name", "") for one in above[1:])]  # the root system has no name here
        if any(one.tag == f"{SSD}DefaultExperiment" for one in found.iterancestors()):
            names.append("DefaultExperiment")
        content = (found.text or "") + "".join(etree.tostring(child, encoding="unicode") for child in found)
        yield Annotation(".".join(filter(None, names)), found.get("type", ""), content.strip())


def number(element: Element | None, attribute: str) -> float | None:
    """The number of an attribute; None where it is missing."""
    text = None if element is None else element.get(attribute)
    return None if text is None else float(text)


def _unit(element: Element) -> Unit:
    base = inside(element, f"{SSC}BaseUnit")
    exponents = tuple(int(base.get(name, 0)) for name in BASES)
    return Unit(element.get("name", ""), exponents, float(base.get("factor", 1.0)), float(base.get("offset", 0.0)))
