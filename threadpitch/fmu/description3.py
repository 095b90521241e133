"""modelDescription.xml, terminalsAndIcons.xml and buildDescription.xml of FMI 3.0, from the declaration.

Source: Functional Mock-up Interface Specification, version 3.0.2, sections 2.4 to 2.6 and 4.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from threadpitch.fmu import dependencies
from threadpitch.fmu.compiler import NO_CONTRACTION
from threadpitch.fmu.description import (
    LOG_CATEGORIES,
    Flavor,
    add_experiment,
    add_log_categories,
    add_units,
    boolean,
    differentiated,
    general_attributes,
    guid,
    interpolated,
    number,
    written,
)
from threadpitch.fmu.model import Model, scalars
from threadpitch.fmu.quantities import (
    UnitUse,
    described,
    has_start,
    simple_type,
    simple_types,
    unit_uses,
    variability,
)
from threadpitch.fmu.variable import Variable
from threadpitch.units import unit

VERSION = "3.0"
TIME = "time"
_ELEMENTS = {"float": "Float64", "int": "Int32", "bool": "Boolean"}
_CATEGORIES = {name: text.replace("fmi2", "fmi3") for name, text in LOG_CATEGORIES.items()}


def references(model: Model) -> dict[str, int]:
    """Value references of FMI 3: variables in the order of the fields from 0, then time, then the clocks."""
    names = [*(variable.name for variable in model.variables), TIME, *(clock.name for clock in model.clocks)]
    return {name: reference for reference, name in enumerate(names)}


def model_description3(model: Model, flavor: Flavor) -> bytes:
    """The bytes of modelDescription.xml (FMI 3.0, co-simulation); equal input gives equal bytes."""
    attributes = {"fmiVersion": VERSION, "modelName": model.class_name, "instantiationToken": guid(model, flavor)}
    root = Element("fmiModelDescription", attributes | general_attributes(model, flavor))
    _add_co_simulation(root, model)
    uses = unit_uses(model)
    if all(use.unit.name != "s" for use in uses):
        uses = tuple(sorted((*uses, UnitUse(unit("s"), ())), key=lambda use: use.unit.name))
    add_units(root, uses)
    _add_types(root, model)
    add_log_categories(root, _CATEGORIES)
    add_experiment(root, model)
    _add_variables(root, model)
    _add_structure(root, model)
    return written(root)


def terminals_and_icons(model: Model) -> bytes:
    """The bytes of terminalsAndIcons/terminalsAndIcons.xml; the picture is ``icon.png`` beside it."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": VERSION})
    corners = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
    picture = SubElement(root, "GraphicalRepresentation")
    SubElement(picture, "CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": "0.1"})
    SubElement(picture, "Icon", corners)
    if model.terminals:
        listed = SubElement(root, "Terminals")
        for terminal in model.terminals:
            attributes = {"name": terminal.name, "matchingRule": "bus"}
            if terminal.description:
                attributes["description"] = terminal.description
            element = SubElement(listed, "Terminal", attributes)
            for member, variable in terminal.members.items():
                SubElement(element, "TerminalMemberVariable", {
                    "variableName": variable, "memberName": member, "variableKind": "signal"})
    return written(root)


def build_description(model: Model, source_files: Iterable[str]) -> bytes:
    """The bytes of sources/buildDescription.xml: these files, in C99, make the library.

    The option keeps ``a * b + c`` rounded twice; where it is passed over, pragmas in the sources do.
    """
    root = Element("fmiBuildDescription", {"fmiVersion": VERSION})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": model.class_name})
    files = SubElement(configuration, "SourceFileSet", {"language": "C99", "compilerOptions": NO_CONTRACTION})
    for name in source_files:
        SubElement(files, "SourceFile", {"name": name})
    return written(root)


def _add_co_simulation(root: Element, model: Model) -> None:
    attributes = {
        "modelIdentifier": model.class_name,
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "providesIntermediateUpdate": boolean(interpolated(model)),
        "hasEventMode": boolean(bool(model.clocks)),
    }
    if differentiated(model):
        attributes["maxOutputDerivativeOrder"] = "1"
    SubElement(root, "CoSimulation", attributes)


def _add_types(root: Element, model: Model) -> None:
    types = simple_types(model)
    if not types:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for kind in types:
        attributes = {"name": kind.name, "quantity": kind.quantity, "unit": kind.unit}
        if kind.display is not None:
            attributes["displayUnit"] = kind.display
        SubElement(definitions, "Float64Type", attributes)


def _add_variables(root: Element, model: Model) -> None:
    reference = references(model)
    variables = SubElement(root, "ModelVariables")
    for variable in model.variables:
        _add_variable(variables, variable, reference[variable.name])
        if interpolated(model) and (variable.derivatives or variable.causality == "output"):
            variables[-1].set("intermediateUpdate", "true")
    SubElement(variables, "Float64", {
        "name": TIME, "valueReference": str(reference[TIME]), "description": "Simulation time",
        "causality": "independent", "variability": "continuous", "unit": "s"})
    for clock in model.clocks:
        attributes = {"name": clock.name, "valueReference": str(reference[clock.name])}
        if clock.description:
            attributes["description"] = clock.description
        SubElement(variables, "Clock", attributes | {
            "causality": "output", "variability": "discrete", "intervalVariability": "triggered"})


def _add_variable(variables: Element, variable: Variable, reference: int) -> None:
    element = SubElement(variables, _ELEMENTS[variable.kind], {
        "name": variable.name,
        "valueReference": str(reference),
        "description": described(variable),
        "causality": variable.causality,
        "variability": variability(variable),
        "initial": "exact" if has_start(variable) else "calculated",
    })
    kind = simple_type(variable)
    if kind is not None:
        element.set("declaredType", kind.name)
    if variable.kind == "float":  # also here, for importers that do not look into the type
        element.set("unit", variable.unit)
        if variable.display is not None:
            element.set("displayUnit", variable.display)
    for name, value in (("min", variable.min), ("max", variable.max), ("nominal", variable.nominal)):
        if value is not None:
            element.set(name, number(value, variable.kind))
    if has_start(variable):
        element.set("start", " ".join([number(variable.start, variable.kind)] * (variable.size or 1)))
    if variable.choices:  # an Int32, as in FMI 2.0; the names are for our own master
        annotation = SubElement(SubElement(element, "Annotations"), "Annotation", {"type": "threadpitch.choices"})
        for name, value in variable.choices.items():
            SubElement(annotation, "Choice", {"name": name, "value": str(value)})
    if variable.size is not None:
        SubElement(element, "Dimension", {"start": str(variable.size)})


def _add_structure(root: Element, model: Model) -> None:
    reference = references(model)
    structure = SubElement(root, "ModelStructure")
    outputs = [variable for variable in model.variables if variable.causality == "output"]
    for variable in outputs:
        _add_unknown(structure, "Output", reference[variable.name], [reference[name] for name in variable.depends_on])
    for clock in model.clocks:
        _add_unknown(structure, "Output", reference[clock.name], [])
    at_start = dict.fromkeys(scalar.variable.name for scalar in dependencies.initial(model, scalars(model)))
    for variable in outputs:
        _add_unknown(structure, "InitialUnknown", reference[variable.name], [reference[name] for name in at_start])
    for clock in model.clocks:  # not ticking
        _add_unknown(structure, "InitialUnknown", reference[clock.name], [])


def _add_unknown(structure: Element, tag: str, reference: int, known: list[int]) -> None:
    """An output and what it depends on; no ``dependencies`` would mean: on everything."""
    SubElement(structure, tag, {
        "valueReference": str(reference),
        "dependencies": " ".join(str(one) for one in known),
        "dependenciesKind": " ".join("dependent" for _ in known),
    })
