"""FMUs of several models, and a whole system packed as an .ssp with the FMUs that it names.

The .ssp is for any tool. libcosim and Ecos pass over parameter bindings of the system, libcosim over all but the first
of a component, and they and FMPy over the units of values, all without a word. So in the .ssp every component has one
parameter set, all of one name, with values in the units of the FMU's variables; people edit the folder's own sets.
Inputs that nothing feeds have no connector in it: FMPy feeds them from the connection of the input before. OMSimulator
looks for its master, step and result file in annotations of its own; what other tools have noted is kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from threadpitch import cosim
from threadpitch.cosim.document import Element, parse_document
from threadpitch.cosim.ssp import FMU_TYPE, SSC, SSD, SSV
from threadpitch.cosim.ssp.schema import inside
from threadpitch.cosim.system import Value
from threadpitch.fmu import BuildError, build_fmu, read_model
from threadpitch.fmu.archive import write_archive
from threadpitch.lathe import find_system, locate_fmu

PARAMETER_FOLDER = "resources/parameters"
_OPENMODELICA = "org.openmodelica"
_OMS = "{https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd}"
_BEFORE_BINDINGS = (f"{SSD}Connectors", f"{SSD}ElementGeometry")  # the order that the schema asks for in a component


@dataclass(frozen=True)
class FmuKind:
    """Which FMUs are built: flavor, FMI version, and of native ones the platforms (None: this machine)."""

    flavor: str
    fmi: int = 2
    platforms: tuple[str, ...] | None = None


def build_models(models: Iterable[Path], folder: Path, kind: FmuKind) -> list[Path]:
    """Build the FMU of every model file into the folder.

    Raises:
        BuildError: two models have one name, and so would their FMUs.
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    models = list(dict.fromkeys(models))
    named: dict[str, Path] = {}
    for path in models:
        name = read_model(path).class_name
        if name.lower() in named:
            raise BuildError(f"{path}: the model {name} is in {named[name.lower()]} too, and both would be written to "
                             f"{name}.fmu; rename one, or build them into different folders")
        named[name.lower()] = path
    return [build_fmu(model, folder, kind.flavor, fmi=kind.fmi, platforms=kind.platforms) for model in models]


def build_system(system: str | Path, folder: Path, kind: FmuKind) -> Path:
    """Pack a system's folder, and the FMUs that its SSD names, as ``<folder name>.ssp``; equal input, equal bytes.

    The values of all its parameter sets go to ``resources/parameters/<component>.ssv``, converted to the variables'
    units.

    Raises:
        cosim.CosimError: the system cannot be read, or an FMU is neither beside it nor a shipped model.
        ModelError, BuildError, OSError: as ``build_fmu``.
    """
    source = find_system(system)
    entries = {path.relative_to(source).as_posix(): path.read_bytes()
               for path in sorted(source.rglob("*")) if path.is_file() and not path.name.startswith(".")}

    def locate(name: str, base: Path) -> Path:
        path = locate_fmu(kind.flavor, name, base, kind.platforms)
        entries[name] = path.read_bytes()
        return path

    with cosim.read_system(source, locate=locate) as structure, cosim.prepare(structure) as plan:
        root = parse_document(source / "SystemStructure.ssd")
        for name in _unbind(root):
            entries.pop(name, None)
        for full, component in _components(inside(root, f"{SSD}System"), ""):
            component.set("type", FMU_TYPE)  # the default, which OMSimulator wants to read
            values = {setting.variable.name: (setting.variable.kind, setting.value) for setting in plan.settings
                      if setting.component == full}
            if values:
                name = f"{PARAMETER_FOLDER}/{full}.ssv"
                entries[name] = _parameter_set(structure.name, values)
                _bind(component, name)
        for element in root.iter(f"{SSD}System"):
            _drop_open_inputs(element)
        _annotate(root, cosim.choose_schedule(plan, stop_time=structure.stop_time or 1.0).step_size)
    entries["SystemStructure.ssd"] = _text(root)
    target = folder / f"{source.name}.ssp"
    write_archive(target, entries)
    return target


def _unbind(root: Element) -> Iterator[str]:
    """Remove all parameter bindings of a system and its components; the files that they named."""
    for bindings in list(root.iter(f"{SSD}ParameterBindings")):
        for binding in bindings.iterfind(f"{SSD}ParameterBinding"):
            yield binding.get("source", "")
        parent = bindings.getparent()
        if parent is not None:
            parent.remove(bindings)


def _bind(component: Element, source: str) -> None:
    """Bind a component to the parameter set in a file."""
    bindings = etree.Element(f"{SSD}ParameterBindings")
    etree.SubElement(bindings, f"{SSD}ParameterBinding", source=source)
    before = [child for child in component if child.tag in _BEFORE_BINDINGS]
    component.insert(component.index(before[-1]) + 1 if before else 0, bindings)


def _components(system: Element, prefix: str) -> Iterator[tuple[str, Element]]:
    """The FMUs of a system and of those nested in it, with their names in the flat system."""
    for element in system.iterfind(f"{SSD}Elements/*"):
        name = f"{prefix}{element.get('name')}"
        if element.tag == f"{SSD}System":
            yield from _components(element, f"{name}.")
        elif element.tag == f"{SSD}Component" and element.get("type", FMU_TYPE) == FMU_TYPE:
            yield name, element


def _drop_open_inputs(system: Element) -> None:
    """Remove the connectors of inputs that no connection reaches; the FMUs' inputs keep their start values."""
    connected = {(connection.get(f"{end}Element"), connection.get(f"{end}Connector"))
                 for connection in system.iterfind(f"{SSD}Connections/{SSD}Connection") for end in ("start", "end")}
    for component in system.iterfind(f"{SSD}Elements/{SSD}Component"):
        for connectors in component.iterfind(f"{SSD}Connectors"):
            for connector in connectors.findall(f"{SSD}Connector"):
                if connector.get("kind") == "input" and (component.get("name"), connector.get("name")) not in connected:
                    connectors.remove(connector)
            if len(connectors) == 0:
                component.remove(connectors)


def _annotate(root: Element, step_size: float) -> None:
    """Tell OMSimulator its master and step, and to record all, unless the SSD tells it already.

    Up to version 2 it reads the element FixedStepMaster; version 3 finds a solver by its name in the attributes.
    """
    step = repr(step_size)
    information = _information(inside(root, f"{SSD}System"))
    if information is not None:
        information.attrib.update({"name": "oms_ma_default", "method": "oms_ma", "fixedStepSize": step})
        etree.SubElement(information, f"{_OMS}FixedStepMaster", description="oms-ma", stepSize=step,
                         absoluteTolerance="0.0001", relativeTolerance="0.0001")
    experiment = root.find(f"{SSD}DefaultExperiment")
    information = None if experiment is None else _information(experiment)
    if information is not None:
        information.attrib.update({"resultFile": f"{root.get('name')}_res.mat", "loggingInterval": "0",
                                   "bufferSize": "1000", "signalFilter": ""})


def _information(owner: Element) -> Element | None:
    """A new annotation of OMSimulator's, which must be the first; None where there is one."""
    annotations = owner.find(f"{SSD}Annotations")
    if annotations is None:
        annotations = etree.SubElement(owner, f"{SSD}Annotations")
    if any(found.get("type") == _OPENMODELICA for found in annotations):
        return None
    annotation = etree.Element(f"{SSC}Annotation", type=_OPENMODELICA)
    annotations.insert(0, annotation)
    outer = etree.SubElement(annotation, f"{_OMS}Annotations", nsmap={"oms": _OMS.strip("{}")})
    return etree.SubElement(outer, f"{_OMS}SimulationInformation")


def _parameter_set(name: str, values: dict[str, tuple[str, Value]]) -> bytes:
    """An SSV of (type, value) by variable, in the variables' own units."""
    root = etree.Element(f"{SSV}ParameterSet", nsmap={"ssv": SSV.strip("{}")}, version="1.0", name=name)
    parameters = etree.SubElement(root, f"{SSV}Parameters")
    for variable, (kind, value) in values.items():
        parameter = etree.SubElement(parameters, f"{SSV}Parameter", name=variable)
        text = str(value).lower() if isinstance(value, bool) else str(value)  # of a float the digits that give it back
        etree.SubElement(parameter, f"{SSV}{kind}", value=text)
    return _text(root)


def _text(root: Element) -> bytes:
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"
