"""What files of other tools look like: what is odd in them and harms nothing is run, the rest is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cosim.ssd_text import (
    bound,
    box,
    laws,
    nested,
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
from threadpitch.cosim import simulate
from threadpitch.cosim.description import FmuError, read_fmu
from threadpitch.cosim.system import Component, System, SystemStructureError

Factory = Callable[..., Path]


def test_empty_lists_and_enumerations_without_a_name(tmp_path: Path) -> None:
    gear = '<ssd:Connectors><ssd:Connector name="gear" kind="input"><ssc:Enumeration/></ssd:Connector></ssd:Connectors>'
    inner = nested("one", system(box("b", "<ssd:Connectors/>"), after="<ssd:Connections/>", before="<ssd:Connectors/>"))
    plan = planned(tmp_path, ssd(system(box("a") + box("c", gear) + inner, wire("a.stage", "c.gear"))))
    assert list(laws(plan)) == ["a.stage -> c.gear"]


def test_a_broken_schema_is_told_without_namespaces(tmp_path: Path) -> None:
    text = ssd(system(box("a", "<ssd:Connectors/>"), wire("a.x", "a.u", attributes='delay="1"')))
    assert "line 1: Element 'Connection', attribute 'delay': The attribute 'delay' is not allowed." in problems(
        tmp_path, text)


def test_another_namespace_is_named(tmp_path: Path) -> None:
    short = "http://ssp-standard.org/SSP1/ParameterValues"
    ssv = f'<s:ParameterSet xmlns:s="{short}" version="1.0" name="set"><s:Parameters/></s:ParameterSet>'
    text = ssd(system(box("a"), before=bound('<ssd:ParameterBinding source="a.ssv"/>')))
    told = problems(tmp_path, text, {"a.ssv": ssv})
    assert f"holds <ParameterSet> of the namespace '{short}', not a ParameterSet of SSP; the namespace of SSP " in told
    assert "is 'http://ssp-standard.org/SSP1/SystemStructureParameterValues'" in told


def test_units_in_brackets(tmp_path: Path) -> None:
    text = ssd(system(box("a"), before=bound(values("a.length Real 250 [mm]"))))
    assert settings(planned(tmp_path, text)) == {"a.length": 0.25}
    assert "unit '[furlong' is not known" in problems(
        tmp_path / "2", text.replace("[mm]", "[furlong"))


def test_integers_feed_enumerations_and_take_them(tmp_path: Path) -> None:
    text = ssd(system(box("a") + box("b"), wire("a.count", "b.gear") + wire("a.stage", "b.number")))
    assert laws(planned(tmp_path, text)) == {"a.count -> b.gear": (1.0, 0.0), "a.stage -> b.number": (1.0, 0.0)}
    assert "joins Boolean to Enumeration" in problems(tmp_path / "2", text.replace("count", "lit"))


@pytest.mark.parametrize(("step", "read_as"), [("1e-4", 1e-4), ("-1", None), ("inf", None), ("quick", None)])
def test_the_step_that_libcosim_notes(tmp_path: Path, step: str, read_as: float | None) -> None:
    note = (f'<ssd:DefaultExperiment><ssd:Annotations><ssc:Annotation type="com.opensimulationplatform">'
            f'<o:Algorithm xmlns:o="http://osp"><o:FixedStepAlgorithm baseStepSize="{step}"/></o:Algorithm>'
            "</ssc:Annotation></ssd:Annotations></ssd:DefaultExperiment>")
    assert read(tmp_path, ssd(system(box("a")), more=note)).step_size == read_as


# What a connector of a system hands on

HANDED = system(box("a"), wire("gain", "a.k") + wire("shift", "a.u"),
                before=ports("parameter gain Real", "input shift Real mm", "input idle Real")
                + bound(values("gain Real 30", "shift Real -20", "a.k Real 10", "a.u Real 4")))


def test_what_a_connector_hands_on_holds_against_a_variables_own_value(tmp_path: Path) -> None:
    assert settings(planned(tmp_path, ssd(HANDED))) == {"a.k": 30.0, "a.u": -0.02}


def test_the_caller_sets_connectors_and_variables_behind_them(tmp_path: Path) -> None:
    text = ssd(HANDED)
    assert settings(planned(tmp_path, text, parameters={"shift": 0.5, "gain": "7"})) == {"a.k": 7.0, "a.u": 0.5}
    assert settings(planned(tmp_path, text, parameters={"shift": "5 mm", "a.k": 1.0})) == {"a.k": 1.0, "a.u": 0.005}


@pytest.mark.parametrize(("name", "given", "message"), [
    ("idle", 1.0, "parameter 'idle': it is a connector of the system that feeds nothing"),
    ("shift", "5 kg", "parameter shift: 5 kg: unit 'kg' cannot be converted to 'mm'"),
    ("shift", "quick", "parameter shift: 'quick' is not a number"),
    ("gane", 1.0, "parameter 'gane': no component 'gane'; write it as component.variable"),
])
def test_wrong_values_for_connectors(tmp_path: Path, name: str, given: object, message: str) -> None:
    with pytest.raises(SystemStructureError, match=message):
        planned(tmp_path, ssd(HANDED), parameters={name: given})


# FMUs that break rules of FMI

def test_an_fmu_with_harmless_faults_runs_and_is_noted(make_fmu: Factory, tmp_path: Path) -> None:
    def edit(text: str) -> str:
        return text.replace('variability="discrete"><Integer/>', 'variability="continuous"><Integer/>').replace(
            'causality="output"><Real unit="m"/>', 'causality="output"><Real unit="bushel"/>')

    odd = make_fmu(tmp_path / "Odd.fmu", edit)
    result = simulate(System("odd", (Component("a", odd),)), stop_time=0.1)
    assert result.steps == 10
    assert any('Odd.fmu: modelDescription.xml: The variable "count"' in note and
               "(and 2 more of this kind); it is run nevertheless" in note for note in result.warnings)


def test_what_can_harm_is_told_before_what_cannot(make_fmu: Factory, tmp_path: Path) -> None:
    twice = '<ScalarVariable name="x" valueReference="99" causality="local"><Real/></ScalarVariable></ModelVariables>'
    broken = make_fmu(tmp_path / "Twice.fmu", lambda text: text.replace("</ModelVariables>", twice).replace(
        'causality="output"><Real unit="m"/>', 'causality="output"><Real unit="bushel"/>'))
    with pytest.raises(FmuError, match=r'modelDescription\.xml is not valid: The variable name "x".* is not unique'):
        read_fmu(broken)
