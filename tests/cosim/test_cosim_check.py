"""Every fault of a system that can be told before it runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.cosim.slaves import description, variable
from threadpitch.cosim.check import Plan, check
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.system import Component, Connection, Connector, ParameterValue, System, SystemStructureError
from threadpitch.units import Unit

GIVER = description(
    variable("position", unit="m"), variable("speed", unit="rad/s"), variable("angle", unit="deg"),
    variable("plain"), variable("odd", unit="bushel"), variable("count", type_="Integer"),
    variable("on", type_="Boolean"), variable("text", type_="String"),
    variable("gain", "parameter", unit="1/s", minimum=0.0), variable("state", "local"))
TAKER = description(
    variable("length", "input", unit="mm"), variable("path", "input", unit="m"), variable("angle", "input", unit="rad"),
    variable("free", "input"), variable("odd", "input", unit="bushel"), variable("number", "input", "Integer"),
    variable("on", "input", "Boolean"), variable("text", "input", "String"),
    variable("start[1]", "parameter", unit="rad"), variable("start[2]", "parameter", unit="rad"),
    variable("kind", "parameter", "Enumeration", choices={"one": 1, "two": 2}))
DESCRIPTIONS = {"giver": GIVER, "taker": TAKER}
COMPONENTS = (Component("giver", Path("Giver.fmu")), Component("taker", Path("Taker.fmu")))


def wire(start: str, end: str, **more: Any) -> Connection:
    giver, given = start.split(".")
    taker, taken = end.split(".")
    return Connection(giver, given, taker, taken, **more)


def checked(*connections: Connection, parameters: dict[str, Any] | None = None, **more: Any) -> Plan:
    return check(System("test", COMPONENTS, connections, **more), DESCRIPTIONS, parameters)


def refusal(*connections: Connection, **more: Any) -> str:
    with pytest.raises(SystemStructureError) as error:
        checked(*connections, **more)
    assert "\n" not in str(error.value)
    return str(error.value)


def conversion(connection: Connection, **more: Any) -> tuple[float, float]:
    link, = checked(connection, **more).links
    return link.factor, link.offset


@pytest.mark.parametrize(("start", "end", "expected"), [
    ("giver.position", "taker.length", (1000.0, 0.0)),
    ("giver.position", "taker.path", (1.0, 0.0)),
    ("giver.angle", "taker.angle", (np.pi / 180.0, 0.0)),
    ("giver.plain", "taker.length", (1.0, 0.0)),  # no unit, no conversion
    ("giver.position", "taker.free", (1.0, 0.0)),
    ("giver.odd", "taker.odd", (1.0, 0.0)),  # equal names need no definition
])
def test_units_are_converted(start: str, end: str, expected: tuple[float, float]) -> None:
    assert conversion(wire(start, end)) == pytest.approx(expected, rel=1e-15)


def test_the_linear_transformation_follows_the_unit_conversion() -> None:
    assert conversion(wire("giver.position", "taker.length", factor=2.0, offset=5.0)) == (2000.0, 5.0)
    alone = wire("giver.position", "taker.length", factor=2.0, offset=5.0, convert_units=False)
    assert conversion(alone) == (2.0, 5.0)


def test_a_connector_may_have_a_unit_of_its_own() -> None:
    """m -> connector in mm -> the same unit, times 2 -> connector in mm -> variable in m."""
    giver = replace(COMPONENTS[0], connectors=(Connector("position", "output", "Real", "mm"),))
    taker = replace(COMPONENTS[1], connectors=(Connector("path", "input", "Real", "mm"),))
    system = System("test", (giver, taker), (wire("giver.position", "taker.path", factor=2.0, offset=3.0),))
    link, = check(system, DESCRIPTIONS).links
    assert (link.factor, link.offset) == pytest.approx((2.0, 0.003), rel=1e-14)


def test_units_of_the_ssd_and_of_the_fmu_come_before_the_table() -> None:
    volume = (0, 3, 0, 0, 0, 0, 0, 0)
    giver = description(variable("volume", unit="peck"), units={"peck": Unit("peck", volume, 0.00875)})
    system = System("test", COMPONENTS, (wire("giver.volume", "taker.odd"),))
    with pytest.raises(SystemStructureError, match="'bushel' is not known"):
        check(system, {"giver": giver, "taker": TAKER})
    named = replace(system, units={"bushel": Unit("bushel", volume, 0.035)})
    link, = check(named, {"giver": giver, "taker": TAKER}).links
    assert link.factor == pytest.approx(0.25)


def test_a_connection_may_be_written_backwards() -> None:
    link, = checked(wire("taker.length", "giver.position")).links
    assert (link.source_component, link.target_component, link.factor) == ("giver", "taker", 1000.0)


@pytest.mark.parametrize(("start", "end", "message"), [
    ("giver.positon", "taker.path", "giver (Test.fmu) has no variable 'positon'; did you mean position?"),
    ("given.position", "taker.path", "no component 'given'; did you mean giver?"),
    ("giver.position", "taker.pat", "did you mean path"),
    ("giver.gain", "taker.path", "joins parameter to input; data go from an output to an input"),
    ("giver.position", "giver.speed", "joins output to output"),
    ("giver.count", "taker.path", "joins Integer to Real"),
    ("giver.on", "taker.number", "joins Boolean to Integer"),
    ("giver.text", "taker.text", "not String"),
    ("giver.speed", "taker.path", "unit 'rad/s' cannot be converted to 'm'"),
    ("giver.odd", "taker.path", "unit 'bushel' is not known"),
])
def test_wrong_connections(start: str, end: str, message: str) -> None:
    text = refusal(wire(start, end))
    assert message in text
    assert f"connection {start} -> {end}" in text


def test_suppressed_conversion_lets_any_units_meet() -> None:
    assert conversion(wire("giver.speed", "taker.path", convert_units=False)) == (1.0, 0.0)


def test_an_input_takes_one_connection() -> None:
    text = refusal(wire("giver.position", "taker.path"), wire("giver.plain", "taker.path"))
    assert "taker.path is fed already by giver.position -> taker.path" in text


def test_a_transformation_of_an_integer_is_refused() -> None:
    assert "serves Real" in refusal(wire("giver.count", "taker.number", factor=2.0))


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(SystemStructureError, match=r"and 2 more problems") as error:
        checked(wire("giver.a", "taker.path"), wire("b.c", "taker.path"), parameters={"giver.gain": -1.0})
    assert len(error.value.problems) == 3


@pytest.mark.parametrize(("connector", "message"), [
    (Connector("positon", "output"), "has no such variable; did you mean position"),
    (Connector("position", "output", "Integer"), "is Integer, but the FMU's variable is Real"),
    (Connector("position", "input"), "is an input, but the FMU's variable is output"),
])
def test_connectors_that_carry_values_must_match_the_fmu(connector: Connector, message: str) -> None:
    components = replace(COMPONENTS[0], connectors=(connector,)), COMPONENTS[1]
    with pytest.raises(SystemStructureError, match=message) as error:
        check(System("test", components, (wire(f"giver.{connector.name}", "taker.path"),)), DESCRIPTIONS)
    assert len(error.value.problems) in (1, 2)


def test_connectors_that_nothing_uses_are_noted() -> None:
    """Tools list connectors of settings of their own; one note for a component tells of them."""
    listed = (Connector("settings_a", "parameter", "Integer"), Connector("settings_b", "parameter"),
              Connector("position", "output", "Binary"))
    plan = check(System("test", (replace(COMPONENTS[0], connectors=listed),)), DESCRIPTIONS)
    assert plan.notes == ("connector giver.settings_a: Test.fmu has no such variable; no connection uses it, nor do 2 "
                          "more of giver",)


def test_a_connector_stands_once() -> None:
    giver = replace(COMPONENTS[0], connectors=(Connector("position", "output"),) * 2)
    with pytest.raises(SystemStructureError, match=r"connector giver\.position stands twice"):
        check(System("test", (giver,)), DESCRIPTIONS)


@pytest.mark.parametrize("numbers", [(float("nan"), 0.0), (1.0, float("inf"))])
def test_transformations_are_finite(numbers: tuple[float, float]) -> None:
    message = refusal(wire("giver.position", "taker.path", factor=numbers[0], offset=numbers[1]))
    assert "giver.position -> taker.path: the LinearTransformation" in message
    assert "is not finite" in message


def test_a_connection_needs_connectors_where_the_ssd_lists_any() -> None:
    giver = replace(COMPONENTS[0], connectors=(Connector("speed", "output"),))
    with pytest.raises(SystemStructureError, match="lists no connector 'position'"):
        check(System("test", (giver, COMPONENTS[1]), (wire("giver.position", "taker.path"),)), DESCRIPTIONS)


def test_names_are_unique_and_some_fmus_run_once_only() -> None:
    with pytest.raises(SystemStructureError, match="'giver' stands twice"):
        check(System("test", (COMPONENTS[0], COMPONENTS[0])), DESCRIPTIONS)
    once: FmuDescription = description(variable("y"), once_per_process=True)
    system = System("test", (Component("a", Path("A.fmu")), Component("b", Path("A.fmu"))))
    with pytest.raises(SystemStructureError, match="only once per process"):
        check(system, {"a": once, "b": once})


def test_connections_to_the_systems_own_connectors_carry_nothing() -> None:
    assert checked(Connection("", "in", "taker", "path"), Connection("giver", "position", "", "out")).links == ()


def settings_of(**more: Any) -> dict[str, object]:
    return {f"{found.component}.{found.variable.name}": found.value for found in checked(**more).settings}


def test_parameters_are_converted_and_arrays_filled() -> None:
    assert settings_of(parameters={"giver.gain": 40, "taker.length": "1.5 inch", "taker.kind": "two",
                                   "taker.start": "0, 180deg"}) == {
        "giver.gain": 40.0, "taker.length": pytest.approx(38.1), "taker.kind": 2,
        "taker.start[1]": 0.0, "taker.start[2]": pytest.approx(np.pi)}
    assert settings_of(parameters={"taker.start": np.array([1.0, 2.0])}) == {
        "taker.start[1]": 1.0, "taker.start[2]": 2.0}
    assert settings_of(parameters={"taker.start": [1.0]}) == {"taker.start[1]": 1.0}
    assert settings_of(parameters={"taker.start[2]": 1}) == {"taker.start[2]": 1.0}


def test_the_callers_parameters_override_those_of_the_system() -> None:
    values = (ParameterValue("giver.gain", 1.0), ParameterValue("giver.gain", 2.0))
    assert settings_of(parameter_values=values) == {"giver.gain": 2.0}
    assert settings_of(parameter_values=values, parameters={"giver.gain": 3.0}) == {"giver.gain": 3.0}


def test_values_for_nothing_in_a_parameter_set_are_noted_and_ignored() -> None:
    plan = checked(parameter_values=(ParameterValue("giver.gian", 1.0, origin="lathe.ssv:7"),))
    assert plan.settings == ()
    assert plan.notes == ("lathe.ssv:7: giver.gian names nothing in the system and is ignored",)


def test_a_value_for_the_systems_connector_reaches_what_it_feeds() -> None:
    plan = checked(Connection("", "advance", "taker", "path"), connectors=(Connector("advance", "input"),),
                   parameter_values=(ParameterValue("advance", 7.0),))
    assert [(found.component, found.variable.name, found.value) for found in plan.settings] == [("taker", "path", 7.0)]


@pytest.mark.parametrize(("name", "value", "message"), [
    ("giver.gian", 1.0, "giver has no variable 'gian'; did you mean gain?"),
    ("gvier.gain", 1.0, "no component 'gvier'; did you mean giver?"),
    ("gain", 1.0, "write it as component.variable"),
    ("giver.gain", -1.0, "parameter giver.gain: -1 1/s is below the minimum of 0 1/s"),
    ("giver.gain", "10mm", "cannot be converted"),
    ("giver.gain", [1.0, 2.0], "not a number, truth value or text"),
    ("giver.position", 1.0, "giver.position cannot be set: it is output"),
    ("giver.state", 1.0, "giver.state cannot be set: it is local"),
    ("taker.start", [1.0, 2.0, 3.0], "3 values for an array of 2"),
    ("taker.start", "1,x", "parameter taker.start[2]: 'x' is not a number"),
    ("taker.kind", "three", "is not a choice"),
])
def test_wrong_parameters(name: str, value: object, message: str) -> None:
    assert message in refusal(parameters={name: value})


def test_a_fed_input_cannot_be_set() -> None:
    text = refusal(wire("giver.position", "taker.path"), parameters={"taker.path": 1.0})
    assert "taker.path cannot be set: giver.position feeds it" in text


def test_a_wrong_value_in_a_parameter_set_names_its_line() -> None:
    text = refusal(parameter_values=(ParameterValue("giver.gain", -1.0, origin="lathe.ssv:7"),))
    assert text.startswith("lathe.ssv:7: giver.gain: -1 1/s is below")
