"""Reading of System Structure and Parameterization 1.0: a folder, an .ssd, an .ssp -> ``System``; an .ssv -> values.

The files are checked against the XML schemas that FMPy ships. The reading itself is our own: FMPy's reader wants a ZIP
archive and drops connector types and units, ``suppressUnitConversion``, the units of parameter sets and (it looks in
the wrong namespace) every LinearTransformation; pyssp_standard 0.9 drops transformations and
``suppressUnitConversion`` too. Both would have changed results in silence.

Nested systems, parameter mappings, signal dictionaries and mapping transformations are refused by name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path, PurePosixPath
from typing import TypeAlias
from urllib.parse import unquote

from lxml import etree

from threadpitch.cosim.archive import TemporaryFolder, unpack
from threadpitch.cosim.document import DocumentError, Element, line_of, parse_document
from threadpitch.cosim.system import (
    Component,
    Connection,
    Connector,
    ParameterValue,
    System,
    SystemStructureError,
    Value,
)
from threadpitch.units import BASES, Unit

Locate: TypeAlias = Callable[[str, Path], Path]

SSD = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
SSC = "{http://ssp-standard.org/SSP1/SystemStructureCommon}"
SSV = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")


def read_system(path: str | Path, *, locate: Locate | None = None) -> System:
    """Read a system from a folder with SystemStructure.ssd, from an .ssd file or from an .ssp archive.

    ``locate(source, base)`` gives the FMU file for a component's source; ``base`` is the SSD's folder. Without it the
    file must lie at ``base / source``. An .ssp is unpacked to a temporary folder that ``System.close`` removes.

    Raises:
        SystemStructureError: the file is missing, is not an SSD or breaks its schema, names what is not supported, or
            refers to a file that does not exist or lies outside of its folder.
        ArchiveError: the .ssp is not a sound archive.
    """
    path = Path(path)
    folder: TemporaryFolder | None = None
    if path.is_dir():
        ssd = path / "SystemStructure.ssd"
    elif path.suffix.lower() == ".ssp":
        folder = unpack(path)
        ssd = folder.path / "SystemStructure.ssd"
    else:
        ssd = path
    if not ssd.is_file():
        where = f"{path}: holds no SystemStructure.ssd" if path.is_dir() or folder else f"{path}: no such file"
        raise SystemStructureError(f"{where}; give an .ssp, an .ssd or a folder with SystemStructure.ssd")
    # People know the archive, not the temporary folder: messages name the former.
    return _Reader(ssd, path.name if folder else str(ssd), locate or locate_file).system(path, folder)


def read_parameter_set(path: str | Path) -> tuple[ParameterValue, ...]:
    """The values of an .ssv file, in its order; names are ``component.variable``.

    Raises:
        SystemStructureError: the file is missing, is not an SSV or breaks its schema.
    """
    path = Path(path)
    root = _parse(path, str(path), "SystemStructureParameterValues.xsd", f"{SSV}ParameterSet")
    return _parameter_set(root, str(path), {})


def locate_file(source: str, base: Path) -> Path:
    """``base / source``, which must be a file.

    Raises:
        SystemStructureError: there is no such file.
    """
    path = base / source
    if not path.is_file():
        raise SystemStructureError(f"FMU {source!r} is not in {base}; put it there or mend the source in the SSD")
    return path


class _Reader:
    """Reads one SSD; ``name`` stands for the file in messages."""

    def __init__(self, ssd: Path, name: str, locate: Locate) -> None:
        self.ssd = ssd
        self.name = name
        self.locate = locate
        self.root = _parse(ssd, name, "SystemStructureDescription.xsd", f"{SSD}SystemStructureDescription")
        self.units = _units(self.root, f"{SSD}Units")

    def system(self, path: Path, folder: TemporaryFolder | None) -> System:
        top = _child(self.root, f"{SSD}System")
        self._refuse_unsupported(top)
        experiment = self.root.find(f"{SSD}DefaultExperiment")
        components = tuple(self._component(element) for element in top.iterfind(f"{SSD}Elements/{SSD}Component"))
        if not components:
            raise SystemStructureError(f"{self.name}: the system holds no component")
        # A value given for the system overrides one given for a component: it comes later (SSP 1.0, bindings).
        values: list[ParameterValue] = []
        for element in top.iterfind(f"{SSD}Elements/{SSD}Component"):
            values += self._bindings(element, f"{element.get('name')}.")
        values += self._bindings(top, "")
        return System(
            name=self.root.get("name", top.get("name", "")),
            components=components,
            connections=tuple(_connection(element) for element in top.iterfind(f"{SSD}Connections/{SSD}Connection")),
            parameter_values=tuple(values),
            connectors=_connectors(top),
            units=self.units,
            start_time=float(experiment.get("startTime", 0.0)) if experiment is not None else 0.0,
            stop_time=_number(experiment, "stopTime") if experiment is not None else None,
            path=path,
            folder=folder,
        )

    def _refuse_unsupported(self, top: Element) -> None:
        unsupported = {
            f"{SSD}Elements/{SSD}System": "nested system",
            f"{SSD}Elements/{SSD}SignalDictionaryReference": "signal dictionary",
            f"{SSD}Elements/{SSD}Component/{SSD}ParameterBindings/{SSD}ParameterBinding/{SSD}ParameterMapping":
                "parameter mapping",
            f"{SSD}ParameterBindings/{SSD}ParameterBinding/{SSD}ParameterMapping": "parameter mapping",
        }
        for kind in ("Boolean", "Integer", "Enumeration"):
            unsupported[f"{SSD}Connections/{SSD}Connection/{SSC}{kind}MappingTransformation"] = (
                f"{kind} mapping transformation")
        for path, what in unsupported.items():
            found = top.find(path)
            if found is not None:
                name = f" {found.get('name')!r}" if found.get("name") else ""
                raise SystemStructureError(f"{self.name}:{line_of(found)}: {what}{name} is not supported; "
                                           "state components and values directly in the system")

    def _component(self, element: Element) -> Component:
        name, line = element.get("name", ""), line_of(element)
        kind = element.get("type", "application/x-fmu-sharedlibrary")
        if kind != "application/x-fmu-sharedlibrary" or element.get("implementation") == "ModelExchange":
            what = "model exchange" if kind == "application/x-fmu-sharedlibrary" else kind
            raise SystemStructureError(f"{self.name}:{line}: component {name!r} is {what}; "
                                       "only FMUs for co-simulation can be run")
        if "." in name:
            raise SystemStructureError(f"{self.name}:{line}: component name {name!r} holds a dot, which parts component"
                                       " and variable in the results; name it without")
        source = self._inside(element.get("source", ""), line)
        try:
            fmu = self.locate(source, self.ssd.parent)
        except SystemStructureError as error:
            raise SystemStructureError(f"{self.name}:{line}: component {name!r}: {error}") from None
        return Component(name, fmu, _connectors(element))

    def _bindings(self, element: Element, owner: str) -> list[ParameterValue]:
        values: list[ParameterValue] = []
        for binding in element.iterfind(f"{SSD}ParameterBindings/{SSD}ParameterBinding"):
            prefix = owner + (binding.get("prefix") or "")
            inline = binding.find(f"{SSD}ParameterValues/{SSV}ParameterSet")
            source = binding.get("source")
            if inline is not None:
                _validate(inline, self.name, "SystemStructureParameterValues.xsd")
                found = _parameter_set(inline, self.name, self.units)
            elif source and binding.get("sourceBase", "SSD") == "SSD":
                relative = self._inside(source, line_of(binding))
                name = f"{self.name}:{line_of(binding)}: {relative}"
                root = _parse(self.ssd.parent / relative, name, "SystemStructureParameterValues.xsd",
                              f"{SSV}ParameterSet")
                found = _parameter_set(root, relative, self.units)
            else:
                raise SystemStructureError(f"{self.name}:{line_of(binding)}: a parameter binding without values; "
                                           "only an inline set or a source beside the SSD can be read")
            values += [replace(value, name=prefix + value.name) for value in found]
        return values

    def _inside(self, uri: str, line: int) -> str:
        """The relative path that a URI names, which stays inside of the SSD's folder."""
        path = unquote(uri)
        parts = PurePosixPath(path)
        if parts.is_absolute() or ".." in parts.parts or ":" in path or "\\" in path or not parts.parts:
            raise SystemStructureError(f"{self.name}:{line}: source {uri!r} is not a path inside of the SSD's folder; "
                                       "put the file beside the SSD and name it relative to it")
        return str(parts)


def _connection(element: Element) -> Connection:
    linear = element.find(f"{SSC}LinearTransformation")
    return Connection(
        element.get("startElement", ""), element.get("startConnector", ""),
        element.get("endElement", ""), element.get("endConnector", ""),
        factor=float(linear.get("factor", 1.0)) if linear is not None else 1.0,
        offset=float(linear.get("offset", 0.0)) if linear is not None else 0.0,
        convert_units=element.get("suppressUnitConversion", "false").strip() not in ("true", "1"),
    )


def _connectors(element: Element) -> tuple[Connector, ...]:
    connectors = []
    for connector in element.iterfind(f"{SSD}Connectors/{SSD}Connector"):
        kind = next(_typed(connector, SSC), None)
        connectors.append(Connector(
            connector.get("name", ""), connector.get("kind", ""),
            None if kind is None else etree.QName(kind).localname, None if kind is None else kind.get("unit")))
    return tuple(connectors)


def _parameter_set(root: Element, name: str, enclosing: dict[str, Unit]) -> tuple[ParameterValue, ...]:
    units = {**enclosing, **_units(root, f"{SSV}Units")}
    values = []
    for parameter in root.iterfind(f"{SSV}Parameters/{SSV}Parameter"):
        origin = f"{name}:{line_of(parameter)}"
        typed = next(_typed(parameter, SSV), None)
        if typed is None:
            raise SystemStructureError(f"{origin}: parameter {parameter.get('name')!r} is neither "
                                       f"{', '.join(TYPES[:-1])} nor {TYPES[-1]}")
        unit = typed.get("unit")
        values.append(ParameterValue(parameter.get("name", ""), _value(typed), unit, origin, units.get(unit or "")))
    return tuple(values)


def _value(typed: Element) -> Value:
    text = typed.get("value", "")
    match etree.QName(typed).localname:
        case "Real":
            return float(text)
        case "Integer":
            return int(text)
        case "Boolean":
            return text.strip() in ("true", "1")
        case _:
            return text


def _typed(element: Element, namespace: str) -> Iterator[Element]:
    return (child for kind in TYPES for child in element.iterfind(namespace + kind))


def _units(root: Element, path: str) -> dict[str, Unit]:
    units = {}
    for element in root.iterfind(f"{path}/{SSC}Unit"):
        base = _child(element, f"{SSC}BaseUnit")
        exponents = tuple(int(base.get(name, 0)) for name in BASES)
        name = element.get("name", "")
        units[name] = Unit(name, exponents, float(base.get("factor", 1.0)), float(base.get("offset", 0.0)))
    return units


def _number(element: Element, attribute: str) -> float | None:
    text = element.get(attribute)
    return None if text is None else float(text)


def _child(element: Element, path: str) -> Element:
    child = element.find(path)
    assert child is not None, path  # the schema has made sure
    return child


def _parse(path: Path, name: str, schema: str, expected: str) -> Element:
    what = etree.QName(expected).localname
    try:
        root = parse_document(path)
    except DocumentError as error:
        raise SystemStructureError(f"{name}: {error}; give a file with a {what} of SSP 1.0") from None
    if root.tag != expected:
        raise SystemStructureError(f"{name}: holds <{etree.QName(root).localname}>, not a {what} of SSP 1.0")
    if not root.get("version", "").startswith("1."):
        raise SystemStructureError(f"{name}: is SSP version {root.get('version')!r}; only 1.0 is read: export it so")
    _validate(root, name, schema)
    return root


def _validate(root: Element, name: str, schema_name: str) -> None:
    with as_file(files("fmpy.ssp") / "schema") as folder:
        schema = etree.XMLSchema(file=str(folder / schema_name))
    try:
        schema.assertValid(root)
    except etree.DocumentInvalid as error:
        raise SystemStructureError(f"{name}: breaks the SSP 1.0 schema: {error}") from None
