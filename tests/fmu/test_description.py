"""modelDescription.xml says what the declaration says, and the pages beside it too."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import read_model_description

from tests.fmu.driving import MODEL_PATHS, TEST_MODEL, names, opened, read
from threadpitch.fmu import Model, build_python_fmu, html_page, markdown_table, model_description, scalars
from threadpitch.fmu.description import Flavor
from threadpitch.units import conversion, unit

FLAVOR = Flavor("python", "a tool", "1", needs_execution_tool=True, content="0")
every_model = pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))


def _root(model: Model) -> ElementTree.Element:
    return ElementTree.fromstring(model_description(model, FLAVOR))


def _found(root: ElementTree.Element, path: str) -> ElementTree.Element:
    element = root.find(path)
    assert element is not None, path
    return element


@every_model
def test_variables_are_the_declared_ones(path: Path) -> None:
    model = read(path)
    elements = list(_found(_root(model), "ModelVariables"))
    for element, scalar in zip(elements, scalars(model), strict=True):
        variable, kind = scalar.variable, element[0]
        assert element.get("name") == scalar.name
        assert element.get("causality") == variable.causality
        assert kind.tag == {"float": "Real", "int": "Integer", "bool": "Boolean"}[variable.kind]
        assert (kind.get("start") is not None) == (variable.causality in ("parameter", "input"))
        for name in ("min", "max", "nominal"):
            declared, written = getattr(variable, name), kind.get(name)
            assert (float(written) if written is not None else None) == declared
        if variable.kind == "float":
            assert (kind.get("unit"), kind.get("displayUnit")) == (variable.unit, variable.display)


@every_model
def test_units_are_those_of_the_table(path: Path) -> None:
    for element in _found(_root(read(path)), "UnitDefinitions"):
        name = element.get("name", "")
        base = {key: int(value) for key, value in _found(element, "BaseUnit").attrib.items()}
        assert base == unit(name).base()
        for shown in element.findall("DisplayUnit"):
            factor, offset = conversion(name, shown.get("name", ""))
            assert (float(shown.get("factor", "1")), float(shown.get("offset", "0"))) == (factor, offset)


@every_model
def test_start_values_are_those_of_the_binary(path: Path, python_fmu: Callable[[Path], Path]) -> None:
    model = read(path)
    with opened(python_fmu(path), model) as fmu:
        for element in _found(_root(model), "ModelVariables"):
            start = element[0].get("start")
            if start is not None:
                value = fmu.get(element.get("name", ""))
                assert start == (str(value).lower() if isinstance(value, bool) else repr(value))


def test_dependencies() -> None:
    model = read(TEST_MODEL)
    root = _root(model)
    index = {scalar.name: str(scalar.reference + 1) for scalar in scalars(model)}
    outputs = {element.get("index"): element.get("dependencies") for element in _found(root, "ModelStructure/Outputs")}
    assert outputs[index["stretch"]] == index["base"]
    assert outputs[index["position"]] == ""
    unknowns = _found(root, "ModelStructure/InitialUnknowns")
    assert {element.get("index") for element in unknowns} == set(outputs)
    # initialize reads the base and the kicks, no force and no parameter
    assert {element.get("dependencies") for element in unknowns} == {f"{index['base']} {index['kicks']}"}


def test_guid_follows_the_content(tmp_path: Path) -> None:
    changed = tmp_path / "damped_mass.py"
    changed.write_text(TEST_MODEL.read_text().replace("0.1 * (self.kicks", "0.2 * (self.kicks"))
    first, again, other = (_root(read(path)).get("guid") for path in (TEST_MODEL, TEST_MODEL, changed))
    assert first == again != other


def test_date_only_from_source_date_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    assert "generationDateAndTime" not in _root(read(TEST_MODEL)).attrib
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    assert _root(read(TEST_MODEL)).get("generationDateAndTime") == "2023-11-14T22:13:20Z"


def test_default_experiment_and_capabilities(tmp_path: Path) -> None:
    description = read_model_description(str(build_python_fmu(read(TEST_MODEL), tmp_path)))
    experiment = description.defaultExperiment
    assert (float(experiment.startTime), float(experiment.stopTime), float(experiment.stepSize)) == (0.0, 1.0, 0.01)
    simulation = description.coSimulation
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert simulation.canHandleVariableCommunicationStepSize
    assert simulation.needsExecutionTool
    assert {category.name for category in description.logCategories} >= {
        "logStatusDiscard", "logStatusError", "logStatusFatal"}


def test_pages_show_display_units_and_escape_text() -> None:
    model = read(TEST_MODEL)
    page = html_page(model)
    assert "A mass &lt; 2 kg &amp; its &quot;spring&quot; on a moving base." in page
    assert "m x&#x27;&#x27; = k (u - x)" in page
    table = markdown_table(model)
    assert "| temperature | Real | degC | 20 | ≥ -273.15 | Temperature |" in table
    assert "| mass | Real | kg | 1 | 0.1 to 2 | Mass |" in table
    assert "| kind | Integer |  | 1 |  | What carries the mass (1 = spring, 2 = rubber) |" in table
    assert "| forces[1..3] | Real | N | 0 |  | Forces on the mass |" in table
