"""modelDescription.xml of FMI 2.0 for co-simulation, from the declaration.

Source: Functional Mock-up Interface for Model Exchange and Co-Simulation, version 2.0.5, sections 2.2 and 4.3.
"""

from __future__ import annotations

import datetime
import os
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from threadpitch.fmu import dependencies
from threadpitch.fmu.model import Model, Scalar, scalars
from threadpitch.fmu.quantities import (
    UnitUse,
    described,
    has_start,
    simple_type,
    simple_types,
    unit_uses,
    variability,
)
from threadpitch.units import Unit

LOG_CATEGORIES = {
    "logStatusWarning": "Messages with status fmi2Warning",
    "logStatusDiscard": "Messages with status fmi2Discard: a step that could not be calculated",
    "logStatusError": "Messages with status fmi2Error",
    "logStatusFatal": "Messages with status fmi2Fatal: parameters that were refused",
    "logAll": "All messages",
}
_ELEMENTS = {"float": "Real", "int": "Integer", "bool": "Boolean"}


@dataclass(frozen=True)
class Flavor:
    """What the description says about the implementation behind it."""

    name: str  # "python" or "native"
    generation_tool: str
    model_version: str
    needs_execution_tool: bool
    content: str  # hexadecimal hash of everything that the FMU calculates with
    source_files: tuple[str, ...] = ()  # C files in sources/

    @property
    def native(self) -> bool:
        """Whether the FMU is machine code: it can interpolate inputs and give the outputs' derivatives."""
        return not self.needs_execution_tool


def guid(model: Model, flavor: Flavor) -> str:
    """A GUID made from the content: equal content gives an equal GUID, on every machine."""
    return "{" + str(uuid.uuid5(uuid.NAMESPACE_OID, f"{flavor.name}\n{flavor.content}\n{model.source}")) + "}"


def build_date() -> str | None:
    """SOURCE_DATE_EPOCH of the environment as UTC date and time; without it no date, so that bytes repeat."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return None
    return datetime.datetime.fromtimestamp(int(epoch), datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def model_description(model: Model, flavor: Flavor) -> bytes:
    """The bytes of modelDescription.xml (FMI 2.0, co-simulation); equal input gives equal bytes."""
    all_scalars = scalars(model)
    attributes = {"fmiVersion": "2.0", "modelName": model.class_name, "guid": guid(model, flavor)}
    root = Element("fmiModelDescription", attributes | general_attributes(model, flavor))
    _add_co_simulation(root, model, flavor)
    add_units(root, unit_uses(model))
    _add_types(root, model)
    add_log_categories(root, LOG_CATEGORIES)
    add_experiment(root, model)
    variables = SubElement(root, "ModelVariables")
    for scalar in all_scalars:
        _add_variable(variables, scalar)
    _add_structure(root, model, all_scalars)
    return written(root)


def written(root: Element) -> bytes:
    """The bytes of an XML file, indented."""
    ElementTree.indent(root, "  ")
    text: bytes = ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _add_co_simulation(root: Element, model: Model, flavor: Flavor) -> None:
    attributes = {
        "modelIdentifier": model.class_name,
        "needsExecutionTool": boolean(flavor.needs_execution_tool),
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
        "canNotUseMemoryManagementFunctions": "true",
    }
    if flavor.native and interpolated(model):
        attributes["canInterpolateInputs"] = "true"
    if flavor.native and differentiated(model):
        attributes["maxOutputDerivativeOrder"] = "1"
    element = SubElement(root, "CoSimulation", attributes)
    if flavor.source_files:
        files = SubElement(element, "SourceFiles")
        for name in flavor.source_files:
            SubElement(files, "File", {"name": name})


def interpolated(model: Model) -> bool:
    """Whether an input takes time derivatives."""
    return any(variable.derivatives for variable in model.variables)


def differentiated(model: Model) -> bool:
    """Whether an output has a time derivative."""
    return any(variable.derivative is not None for variable in model.variables)


def general_attributes(model: Model, flavor: Flavor) -> dict[str, str]:
    """The attributes of the root that FMI 2.0 and 3.0 share."""
    summary = model.description.split("\n\n")[0].split()
    attributes = {}
    if summary:
        attributes["description"] = " ".join(summary)
    attributes["version"] = flavor.model_version
    attributes["generationTool"] = flavor.generation_tool
    date = build_date()
    if date is not None:
        attributes["generationDateAndTime"] = date
    attributes["variableNamingConvention"] = "structured"
    return attributes


def add_log_categories(root: Element, categories: Mapping[str, str]) -> None:
    """LogCategories, the same in FMI 2.0 and 3.0."""
    listed = SubElement(root, "LogCategories")
    for name, text in categories.items():
        SubElement(listed, "Category", {"name": name, "description": text})


def add_experiment(root: Element, model: Model) -> None:
    """DefaultExperiment, the same in FMI 2.0 and 3.0."""
    if model.experiment is not None:
        SubElement(root, "DefaultExperiment", {
            "startTime": repr(float(model.experiment.start_time)),
            "stopTime": repr(float(model.experiment.stop_time)),
            "stepSize": repr(float(model.experiment.step_size)),
        })


def add_units(root: Element, uses: Sequence[UnitUse]) -> None:
    """UnitDefinitions, the same in FMI 2.0 and 3.0."""
    if not uses:
        return
    definitions = SubElement(root, "UnitDefinitions")
    for use in uses:
        element = SubElement(definitions, "Unit", {"name": use.unit.name})
        SubElement(element, "BaseUnit", _base(use.unit))
        for name, factor, offset in use.displays:
            attributes = {"name": name, "factor": repr(factor)}
            if offset != 0.0:
                attributes["offset"] = repr(offset)
            SubElement(element, "DisplayUnit", attributes)


def _base(known: Unit) -> dict[str, str]:
    return {name: str(power) for name, power in known.base().items()}


def _add_types(root: Element, model: Model) -> None:
    types = simple_types(model)
    if not types:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for kind in types:
        attributes = {"quantity": kind.quantity, "unit": kind.unit}
        if kind.display is not None:
            attributes["displayUnit"] = kind.display
        SubElement(SubElement(definitions, "SimpleType", {"name": kind.name}), "Real", attributes)


def _add_variable(variables: Element, scalar: Scalar) -> None:
    variable = scalar.variable
    element = SubElement(variables, "ScalarVariable", {
        "name": scalar.name,
        "valueReference": str(scalar.reference),
        "description": described(variable),
        "causality": variable.causality,
        "variability": variability(variable),
    })
    if variable.causality != "input":  # FMI 2.0 section 2.2.7: initial is not allowed for inputs
        element.set("initial", "exact" if variable.causality == "parameter" else "calculated")
    attributes: dict[str, str] = {}
    kind = simple_type(variable)
    if kind is not None:
        attributes["declaredType"] = kind.name
    if variable.kind == "float":  # also here, for importers that do not look into the type
        attributes["unit"] = variable.unit
        if variable.display is not None:
            attributes["displayUnit"] = variable.display
    for name, value in (("min", variable.min), ("max", variable.max), ("nominal", variable.nominal)):
        if value is not None:
            attributes[name] = number(value, variable.kind)
    if has_start(variable):
        attributes["start"] = number(variable.start, variable.kind)
    SubElement(element, _ELEMENTS[variable.kind], attributes)
    if variable.choices:  # an Integer, because importers leave Enumerations out; the names are for our own master
        tool = SubElement(SubElement(element, "Annotations"), "Tool", {"name": "threadpitch"})
        choices = SubElement(tool, "Choices")
        for name, value in variable.choices.items():
            SubElement(choices, "Choice", {"name": name, "value": str(value)})


def _add_structure(root: Element, model: Model, all_scalars: tuple[Scalar, ...]) -> None:
    structure = SubElement(root, "ModelStructure")
    outputs = [scalar for scalar in all_scalars if scalar.variable.causality == "output"]
    if not outputs:
        return
    listed = SubElement(structure, "Outputs")
    unknowns = SubElement(structure, "InitialUnknowns")
    at_start = dependencies.initial(model, all_scalars)
    for scalar in outputs:
        _add_unknown(listed, scalar, dependencies.direct(all_scalars, scalar))
        _add_unknown(unknowns, scalar, at_start)


def _add_unknown(parent: Element, scalar: Scalar, known: tuple[Scalar, ...]) -> None:
    """An output and what it depends on; no ``dependencies`` would mean: on everything."""
    SubElement(parent, "Unknown", {
        "index": str(scalar.reference + 1),  # the position in ModelVariables, from 1
        "dependencies": " ".join(str(one.reference + 1) for one in known),
        "dependenciesKind": " ".join("dependent" for _ in known),
    })


def number(value: float | int | bool, kind: str) -> str:
    """A value of this kind ("float", "int" or "bool") in XML; floats read back bit for bit."""
    if kind == "bool":
        return boolean(bool(value))
    return repr(float(value)) if kind == "float" else str(value)


def boolean(value: bool) -> str:
    """``true`` or ``false``."""
    return "true" if value else "false"
