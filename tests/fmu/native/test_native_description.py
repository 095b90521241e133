"""modelDescription.xml of native FMUs, terminals, and the declarations behind them."""

from __future__ import annotations

import zipfile
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import pytest
from lxml import etree

from tests.fmu.driving import MODEL_PATHS, TABLE_MODEL, TEST_MODEL, bits, names, opened3, read
from tests.fmu.native.building import built, every_model, needs_compiler
from threadpitch.fmu import Model, ModelError, model_description, model_description3, read_model
from threadpitch.fmu.description import Flavor
from threadpitch.fmu.description3 import build_description, references, terminals_and_icons

FLAVOR = Flavor("native", "a tool", "1", needs_execution_tool=False, content="0", source_files=("a.c", "b.c"))
COMMAND = 'Terminal("command", {"speed": "speed_command", "hold": "hold"})'
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


def _root3(model: Model) -> ElementTree.Element:
    return ElementTree.fromstring(model_description3(model, FLAVOR))


def _found(root: ElementTree.Element, path: str) -> ElementTree.Element:
    element = root.find(path)
    assert element is not None, path
    return element


@every_model
def test_variables_of_fmi3_are_the_declared_ones(path: Path) -> None:
    model = read(path)
    elements = list(_found(_root3(model), "ModelVariables"))
    by_name = {element.get("name"): element for element in elements}
    assert len(elements) == len(by_name) == len(model.variables) + 1 + len(model.clocks)
    for variable in model.variables:
        element = by_name[variable.name]
        assert element.tag == {"float": "Float64", "int": "Int32", "bool": "Boolean"}[variable.kind]
        assert element.get("causality") == variable.causality
        dimension = element.find("Dimension")
        assert (None if dimension is None else int(dimension.get("start", ""))) == variable.size
        if variable.causality in ("parameter", "input"):
            assert len(element.get("start", "").split()) == (variable.size or 1)
        if variable.kind == "float":
            assert (element.get("unit"), element.get("displayUnit")) == (variable.unit, variable.display)
        assert "clocks" not in element.attrib
    assert by_name["time"].get("causality") == "independent"
    assert [by_name[name].get("valueReference") for name in by_name] == [
        str(references(model)[str(name)]) for name in by_name]


@needs_compiler
@every_model
def test_start_values_of_fmi3_are_those_of_the_binary(path: Path) -> None:
    model = read(path)
    by_name = {element.get("name"): element for element in _found(_root3(model), "ModelVariables")}
    with opened3(built(path, 3), model) as fmu:
        found = fmu.everything()
        for variable in model.variables:
            start = by_name[variable.name].get("start")
            for index, text in enumerate((start or "").split(), 1):
                name = variable.name if variable.size is None else f"{variable.name}[{index}]"
                value = text == "true" if variable.kind == "bool" else float(text)
                assert found[name] == bits(int(value) if variable.kind == "int" else value)


def test_structure_of_fmi3() -> None:
    model = read(TABLE_MODEL)
    reference = references(model)
    structure = _found(_root3(model), "ModelStructure")
    outputs = {element.get("valueReference"): element.get("dependencies") for element in structure.findall("Output")}
    assert outputs[str(reference["speed"])] == str(reference["hold"])
    assert outputs[str(reference["angle"])] == ""
    assert outputs[str(reference["turn_clock"])] == ""
    unknowns = {element.get("valueReference"): element.get("dependencies")
                for element in structure.findall("InitialUnknown")}
    assert unknowns.keys() == outputs.keys()
    assert unknowns[str(reference["travel"])] == str(reference["other_command"])


def test_capabilities_follow_the_declarations() -> None:
    table, mass = read(TABLE_MODEL), read(TEST_MODEL)
    shown = {}
    for model in (table, mass):
        second = _found(ElementTree.fromstring(model_description(model, FLAVOR)), "CoSimulation")
        third = _found(_root3(model), "CoSimulation")
        assert [file.get("name") for file in second.findall("SourceFiles/File")] == ["a.c", "b.c"]
        assert second.get("needsExecutionTool") == third.get("needsExecutionTool") == "false"
        shown[model.class_name] = [second.get("canInterpolateInputs"), second.get("maxOutputDerivativeOrder"),
                                   third.get("maxOutputDerivativeOrder"), third.get("providesIntermediateUpdate"),
                                   third.get("hasEventMode")]
    assert shown == {"RotaryTable": ["true", "1", "1", "true", "true"],
                     "DampedMass": [None, None, None, "false", "false"]}
    updated = {element.get("name") for element in _found(_root3(table), "ModelVariables")
               if element.get("intermediateUpdate") == "true"}
    outputs = {variable.name for variable in table.variables if variable.causality == "output"}
    assert updated == outputs | {"speed_command", "other_command"}
    python = Flavor("python", "a tool", "1", needs_execution_tool=True, content="0")
    element = _found(ElementTree.fromstring(model_description(table, python)), "CoSimulation")
    assert element.get("canInterpolateInputs") is None  # PythonFMU's library refuses them


@pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))
def test_the_other_files_fit_their_schemas(path: Path) -> None:
    model = read(path)
    for schema, content in (("fmi3TerminalsAndIcons.xsd", terminals_and_icons(model)),
                            ("fmi3BuildDescription.xsd", build_description(model, ["a.c"])),
                            ("fmi3ModelDescription.xsd", model_description3(model, FLAVOR))):
        etree.XMLSchema(etree.parse(SCHEMAS / schema)).assertValid(etree.fromstring(content))


def test_terminals_group_what_is_declared() -> None:
    root = ElementTree.fromstring(terminals_and_icons(read(TABLE_MODEL)))
    found = {terminal.get("name"): {member.get("memberName"): member.get("variableName") for member in terminal}
             for terminal in _found(root, "Terminals")}
    assert found == {"shaft": {"angle": "angle", "speed": "speed"},
                     "command": {"speed": "speed_command", "hold": "hold"}}
    assert ElementTree.fromstring(terminals_and_icons(read(TEST_MODEL))).find("Terminals") is None


@needs_compiler
def test_the_token_is_the_one_in_the_binary() -> None:
    for fmi, attribute in ((2, "guid"), (3, "instantiationToken")):
        with zipfile.ZipFile(built(TEST_MODEL, fmi)) as archive:
            token = ElementTree.fromstring(archive.read("modelDescription.xml")).get(attribute, "")
            assert token.encode() in archive.read("sources/model.c")


@pytest.mark.parametrize(("change", "message"), [
    (('derivatives=("command_rate", "command_bend")', 'derivatives=("command_rate", "speed")'),
     r"speed_command: derivatives names 'speed'; name a float state in the unit of d2/dt2"),
    (('derivatives=("command_rate", "command_bend")', 'derivatives=("other_rate",)'), "derivatives names 'other_rate'"),
    (('derivatives=("other_rate",)', 'derivatives=("nothing",)'), "other_command: derivatives names 'nothing'"),
    (('derivatives=("other_rate",)', 'derivatives=("other_rate", "other_rate", "other_rate")'), "at most 2 names"),
    (('"A second command", derivatives', '"A second command", discrete=True, derivatives'),
     "derivatives of what is not a continuous float"),
    (('derivative="speed"', 'derivative="travel"'), "angle: derivative names 'travel'"),
    (('derivative="speed"', 'derivative="speed", discrete=True'), "derivative of what is not a continuous float"),
    (('ticks="turns"', 'ticks="speed"'), "CLOCKS: turn_clock ticks by 'speed'; name an int output"),
    (("element=1", "element=2"), "ticks by element 2 of turns; give one from 0 to 1"),
    (('Clock("turn_clock"', 'Clock("speed"'), "the name 'speed' is taken"),
    ((COMMAND, "7"), "TERMINALS must be a tuple of Terminal"),
    ((COMMAND, 'Terminal("shaft", {"a": "angle"})'), "TERMINALS: the name 'shaft' is there twice"),
    (('{"angle": "angle", "speed": "speed"}', "{}"), "TERMINALS: shaft has no members"),
    (('{"angle": "angle", "speed": "speed"}', '{"angle": "limit"}'), "shaft has the member 'angle': 'limit'"),
    (('limit: float', 'time: float'), "time: this name has a meaning in C"),
])
def test_declarations_that_do_not_fit_are_refused(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = tmp_path / "table.py"
    text = TABLE_MODEL.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(ModelError, match=message) as caught:
        read_model(path)
    assert "\n" not in str(caught.value)
