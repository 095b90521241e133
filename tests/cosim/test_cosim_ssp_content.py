"""SSP in full: parameter mappings, tables, signal dictionaries, arrays of SSP 2.0, annotations, replacements."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from tests.cosim.ssd_text import (
    INNER,
    LINEAR,
    SPACES,
    bound,
    box,
    entry,
    laws,
    nested,
    pairs,
    planned,
    ports,
    problems,
    read,
    settings,
    ssd,
    system,
    values,
    wire,
)
from threadpitch.cosim.ssp import read_system
from threadpitch.cosim.system import Connector, SystemStructureError

MAPPING = '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{}</ssm:ParameterMapping></ssd:ParameterMapping>'


@pytest.mark.parametrize(("value", "entries", "expected"), [
    ("p Real 3", entry("p", "a.k") + entry("p", "b.k"), {"a.k": 3.0, "b.k": 3.0}),
    ("a.k Real 3", entry("other", "a.k"), {}),  # what no entry names is not applied, under its own name neither
    ("p Real 3 mm", entry("p", "a.length", LINEAR), {"a.length": pytest.approx(1.006)}),
    ("p Real 3 mm", entry("p", "a.length", LINEAR, 'suppressUnitConversion="true"'), {"a.length": 7.0}),
    ("p Integer 4", entry("p", "a.number", pairs("Integer", "4=7", "7=9")), {"a.number": 7}),
    ("p Integer 5", entry("p", "a.number", pairs("Integer", "4=7")), {"a.number": 5}),
    ("p Boolean true", entry("p", "a.on", pairs("Boolean", "true=false")), {"a.on": False}),
    ("p Enumeration quick", entry("p", "a.mode", pairs("Enumeration", "quick=fast")), {"a.mode": 2}),
    ("p Integer 8", entry("p", "a.mode", pairs("Integer", "8=1")), {"a.mode": 1}),
])
def test_parameter_mappings(value: str, entries: str, expected: dict[str, object], tmp_path: Path) -> None:
    inline = bound(values(value, mapping=MAPPING.format(entries)))
    assert settings(planned(tmp_path / "1", ssd(system(box("a") + box("b"), before=inline)))) == expected
    outside = bound(values(value, mapping='<ssd:ParameterMapping source="names.ssm"/>'))
    files = {"names.ssm": f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'}
    assert settings(planned(tmp_path / "2", ssd(system(box("a") + box("b"), before=outside)), files)) == expected


def test_a_mapping_of_another_type_is_told(tmp_path: Path) -> None:
    wrong = bound(values("p Real 3", mapping=MAPPING.format(entry("p", "a.k", pairs("Integer", "3=4")))))
    assert "a mapping of Integer values serves no float values" in problems(
        tmp_path, ssd(system(box("a"), before=wrong)))


def test_a_set_inside_of_the_fmu(tmp_path: Path) -> None:
    binding = '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component"/>'
    text = ssd(system(f'<ssd:Component name="a" source="a.zip.fmu">{bound(binding)}</ssd:Component>'))
    own = (f'<ssv:ParameterSet {SPACES} version="1.0" name="own"><ssv:Parameters><ssv:Parameter name="k">'
           '<ssv:Real value="8"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>')
    with zipfile.ZipFile(tmp_path / "a.zip.fmu", "w") as packed:
        packed.writestr("resources/own.ssv", own)
    assert settings(planned(tmp_path, text)) == {"a.k": 8.0}


# Transformations of connections

@pytest.mark.parametrize(("connection", "expected"), [
    (wire("a.count", "b.number", pairs("Integer", "1=5", "2=2", "3=1")), ((1, 5), (3, 1))),
    (wire("a.lit", "b.on", pairs("Boolean", "true=false", "false=true")), ((0, 1), (1, 0))),
    (wire("a.stage", "b.gear", pairs("Enumeration", "second=low", "third=high")), ((2, 1), (3, 2))),
    (wire("a.stage", "b.gear", pairs("Integer", "3=2")), ((3, 2),)),
])
def test_mapping_transformations_become_tables(connection: str, expected: object, tmp_path: Path) -> None:
    link, = planned(tmp_path, ssd(system(box("a") + box("b"), connection))).links
    assert link.table == expected


def test_tables_of_several_levels_become_one(tmp_path: Path) -> None:
    """1 -> 2 -> 3, 2 -> 3, 3 -> 3, 4 -> 1 -> 1."""
    inner = system(box("box"), wire("n", "box.number", pairs("Integer", "2=3")), ports("input n Integer"))
    text = ssd(system(box("a") + nested("one", inner), wire("a.count", "one.n", pairs("Integer", "1=2", "4=1"))))
    assert planned(tmp_path, text).links[0].table == ((1, 3), (2, 3), (4, 1))


@pytest.mark.parametrize(("connection", "message"), [
    (wire("a.x", "b.u", pairs("Integer", "1=2")), "a mapping of Integer values serves no Real variables"),
    (wire("a.lit", "b.on", pairs("Integer", "1=2")), "a mapping of Integer values serves no Boolean variables"),
    (wire("a.count", "b.number", LINEAR), "a linear transformation serves Real variables, not Integer"),
    (wire("a.stage", "b.gear", pairs("Enumeration", "last=low")), "names 'last', no item of the enumeration"),
    (wire("a.stage", "b.gear", pairs("Integer", "3=9")), "the mapping gives 9, which is no value of gear"),
])
def test_wrong_mapping_transformations(connection: str, message: str, tmp_path: Path) -> None:
    assert message in problems(tmp_path, ssd(system(box("a") + box("b"), connection)))


# Signal dictionaries

BUS = ('<ssd:SignalDictionaries><ssd:SignalDictionary name="bus">{}</ssd:SignalDictionary></ssd:SignalDictionaries>')
ENTRIES = (f'<ssb:SignalDictionary {SPACES} version="1.0"><ssb:DictionaryEntry name="speed"><ssc:Real unit="mm"/>'
           '</ssb:DictionaryEntry><ssb:Units><ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'
           "</ssb:Units></ssb:SignalDictionary>")


def reference(name: str, connectors: str = "inout speed") -> str:
    return (f'<ssd:SignalDictionaryReference name="{name}" dictionary="bus">{ports(connectors)}'
            "</ssd:SignalDictionaryReference>")


@pytest.mark.parametrize("external", [False, True])
def test_signals_of_a_dictionary_reach_every_level(external: bool, tmp_path: Path) -> None:
    inner = nested("one", system(reference("tap") + box("b"), wire("tap.speed", "b.u")))
    bus = BUS.replace('name="bus">{}', 'name="bus" source="bus.ssb">') if external else BUS.format(ENTRIES)
    text = ssd(system(box("a") + inner + reference("plug"), wire("a.x", "plug.speed", LINEAR), after=bus))
    found = laws(planned(tmp_path, text, {"bus.ssb": ENTRIES}))
    assert found == {"a.x -> one.b.u": (pytest.approx(2.0), pytest.approx(0.001))}  # doubled, and 1 mm more


@pytest.mark.parametrize(("elements", "wires", "message"), [
    (box("a") + reference("plug", "inout sped"), "", "has no signal 'sped'; did you mean speed?"),
    (box("a") + reference("plug").replace('"bus"', '"bux"'), "", "no signal dictionary 'bux'; did you mean bus?"),
    (box("a") + box("b") + box("c") + reference("plug") + reference("tap"),
     wire("a.x", "plug.speed") + wire("b.x", "tap.speed") + wire("plug.speed", "c.u"), "is fed already by a.x"),
])
def test_wrong_signals(elements: str, wires: str, message: str, tmp_path: Path) -> None:
    assert message in problems(tmp_path, ssd(system(elements, wires, after=BUS.format(ENTRIES))))


# SSP 2.0

def array(kind: str, name: str, size: int = 2) -> str:
    return (f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Float64 unit="m"/><ssc:Dimension size="{size}"/>'
            "</ssd:Connector>")


def test_arrays_are_connected_whole_and_by_element(tmp_path: Path) -> None:
    ends = box("a", f"<ssd:Connectors>{array('output', 'v')}</ssd:Connectors>") + box(
        "b", f"<ssd:Connectors>{array('input', 'w')}</ssd:Connectors>") + box("c")
    text = ssd(system(ends, wire("a.v", "b.w") + wire("a.v", "c.w", attributes='startIndices="2" endIndices="1"')),
               "2.0")
    assert list(laws(planned(tmp_path, text))) == ["a.v[1] -> b.w[1]", "a.v[2] -> b.w[2]", "a.v[2] -> c.w[1]"]


def test_arrays_pass_through_systems(tmp_path: Path) -> None:
    inner = nested("one", system(box("b") + box("c"), wire("v", "b.w") + wire(
        "v", "c.u", attributes='startIndices="2"'), f"<ssd:Connectors>{array('input', 'v')}</ssd:Connectors>"))
    text = ssd(system(box("a") + inner, wire("a.v", "one.v")), "2.0")
    assert list(laws(planned(tmp_path, text))) == ["a.v[1] -> one.b.w[1]", "a.v[2] -> one.b.w[2]", "a.v[2] -> one.c.u"]


@pytest.mark.parametrize(("connection", "size", "message"), [
    (wire("a.v", "b.u"), 2, "joins 2 values to 1; arrays must have equal sizes"),
    (wire("a.v", "b.w", attributes='startIndices="3"'), 2, "has no variable 'v[3]'; did you mean v[2], v[1]?"),
    (wire("a.v", "b.w"), 3, "connector a.v: has 3 elements, but the FMU's variable has 2"),
])
def test_wrong_arrays(connection: str, size: int, message: str, tmp_path: Path) -> None:
    ends = box("a", f"<ssd:Connectors>{array('output', 'v', size)}</ssd:Connectors>") + box("b")
    assert message in problems(tmp_path, ssd(system(ends, connection), "2.0"))


SSV2 = (f'<ssv:ParameterSet {SPACES} version="2.0" name="two"><ssv:Parameters>'
        '<ssv:Parameter name="a.a"><ssv:Float64 value="1.5 -2"/><ssc:Dimension size="2"/></ssv:Parameter>'
        '<ssv:Parameter name="a.number"><ssv:Int32 value="7"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>")


def test_parameters_of_ssp_2(tmp_path: Path) -> None:
    text = ssd(system(box("a"), before=bound('<ssd:ParameterBinding source="two.ssv"/>')), "2.0")
    assert settings(planned(tmp_path / "1", text, {"two.ssv": SSV2})) == {"a.a[1]": 1.5, "a.a[2]": -2.0, "a.number": 7}
    assert "holds 2 values for an array of 3" in problems(tmp_path / "2", text, {
        "two.ssv": SSV2.replace('size="2"', 'size="3"')})
    huge = SSV2.replace('<ssc:Dimension size="2"/>', '<ssc:Dimension size="999999999"/>' * 4)
    assert "for an array of 999999999 x" in problems(tmp_path / "3", text, {"two.ssv": huge})


def test_each_file_keeps_the_schema_of_its_own_version(tmp_path: Path) -> None:
    connector = '<ssd:Connectors><ssd:Connector name="u" kind="input"><ssc:Float64/></ssd:Connector></ssd:Connectors>'
    assert "breaks the SSP 1.0 schema" in problems(tmp_path, ssd(system(box("a", connector))))
    structure = read(tmp_path, ssd(system(box("a", connector)), "2.0"))
    assert structure.components[0].connectors == (Connector("u", "input", "Float64"),)


# What a system carries besides

def test_annotations_are_kept_and_tell_the_step(tmp_path: Path) -> None:
    master = ('<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations xmlns:oms="https://oms">'
              '<oms:SimulationInformation><oms:FixedStepMaster description="oms-ma" stepSize="0.025"/>'
              "</oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations>")
    note = '<ssd:Annotations><ssc:Annotation type="com.example"><n xmlns="">left</n></ssc:Annotation></ssd:Annotations>'
    structure = read(tmp_path, ssd(system(nested("one", system(box("a", note))), after=master)))
    assert structure.step_size == 0.025
    assert [(found.owner, found.type) for found in structure.annotations] == [
        ("one.a", "com.example"), ("", "org.openmodelica")]
    assert ">left</n>" in structure.annotations[0].content
    assert 'stepSize="0.025"' in structure.annotations[1].content


def test_a_component_is_replaced(tmp_path: Path) -> None:
    text = ssd(system(nested("one", INNER) + '<ssd:Component name="b" source="Gone.fmu"/>'))
    with pytest.raises(SystemStructureError, match=r"'Gone\.fmu' does not lie beside"):
        read(tmp_path, text)
    other = tmp_path / "Other.fmu"
    other.write_text("fmu")
    structure = read_system(tmp_path, replace={"b": other, "one.box": str(other)})
    assert [component.fmu for component in structure.components] == [other, other]
    with pytest.raises(SystemStructureError) as error:
        read_system(tmp_path, replace={"b": tmp_path / "None.fmu", "one.bx": other})
    assert "None.fmu: no such file" in error.value.problems[0]
    assert error.value.problems[1] == "replacement: no component 'one.bx'; did you mean one.box?"


def test_all_problems_of_all_files_are_told_at_once(tmp_path: Path) -> None:
    text = ssd(system('<ssd:Component name="a" source="A.fmu"/><ssd:Component name="b" source="../B.fmu"/>'
                      '<ssd:Component name="c"/>' + nested("n", system('<ssd:Component name="d" source="D.fmu"/>')),
                      before=bound('<ssd:ParameterBinding source="gone.ssv"/>')), "2.0")
    found = problems(tmp_path, text)
    for message in ("'a': FMU 'A.fmu' does not lie beside", "'../B.fmu' is not a path inside", "'c' names no source",
                    "'n.d': FMU 'D.fmu' does not lie beside", "gone.ssv: no such file"):
        assert message in found
