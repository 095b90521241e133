"""Real FMUs: a C probe that fails on demand; the whole way from a file to a result."""

from __future__ import annotations

import os
import pickle
import re
import signal
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import Parameter, ParameterSet

from threadpitch.cosim import CosimError, SimulationInterrupted, StepError, SystemStructureError, simulate
from threadpitch.cosim.description import FmuError, read_fmu
from threadpitch.cosim.system import Component, Connection, System

Factory = Callable[..., Path]


def system(fmu: Path, *connections: Connection, names: str = "ab", **more: Any) -> System:
    return System("probes", tuple(Component(name, fmu) for name in names), connections, **more)


def euler(k: float, start: float, step: float, steps: int) -> np.ndarray:
    x = [start]
    for _ in range(steps):
        x.append(x[-1] + step * (0.0 - k * x[-1]))
    return np.array(x)


def test_a_decay_is_stepped_bit_for_bit(probe_fmu: Path) -> None:
    result = simulate(system(probe_fmu, names="a"), parameters={"a.k": 2.0, "a.start_x": "1000mm"}, stop_time=1.0)
    assert result.schedule.steps == 100  # the FMU recommends 0.01 s
    assert result["a.x"].tobytes() == euler(2.0, 1.0, 0.01, 100).tobytes()
    assert result["a.count"].tolist() == list(range(101))
    assert result.units["a.x"] == "m"
    assert result.completed
    assert result.warnings == ()


def test_every_type_travels_along_connections(probe_fmu: Path) -> None:
    joined = system(probe_fmu, Connection("a", "x", "b", "u"), Connection("a", "count", "b", "number"),
                    Connection("a", "flag_out", "b", "flag"))
    result = simulate(joined, parameters={"a.start_x": 1.0, "a.flag": True}, stop_time=0.1,
                      record=("b.*", "a.x", "a.count"))
    assert result["b.number_out"].tolist() == list(range(11))
    assert result["b.flag_out"].all()
    assert result["b.flag_out"].dtype == np.bool_
    assert result["b.twice"].tolist() == (2.0 * result["a.x"]).tolist()
    assert result["b.u"].tolist() == result["a.x"].tolist()  # recorded inputs and parameters too
    assert "b.k" in result
    assert "a.twice" not in result


def test_units_and_transformation_reach_the_fmu(make_fmu: Factory, tmp_path: Path) -> None:
    millimetres = make_fmu(tmp_path / "Mm.fmu", lambda text: text.replace(
        'name="u" valueReference="0" causality="input"><Real unit="m"',
        'name="u" valueReference="0" causality="input"><Real unit="mm"'))
    joined = system(millimetres, Connection("a", "x", "b", "u", factor=2.0, offset=0.5))
    result = simulate(joined, parameters={"a.start_x": 1.0}, stop_time=0.1)
    assert result["b.twice"] == pytest.approx(2.0 * (2.0 * 1000.0 * result["a.x"] + 0.5), rel=1e-15)


def test_display_units_of_the_fmu_are_known(probe_fmu: Path) -> None:
    result = simulate(system(probe_fmu, names="a"), parameters={"a.start_x": "0.1furlong"}, stop_time=0.01)
    assert result["a.x"][0] == pytest.approx(20.1168, rel=1e-12)


def test_arrays_choices_and_texts_are_set(probe_fmu: Path) -> None:
    result = simulate(system(probe_fmu, names="a"), stop_time=0.01, record=("parameters",),
                      parameters={"a.gain": "1mm, 2mm", "a.mode": "fast", "a.label": "left"})
    assert [result[f"a.gain[{n}]"][0] for n in (1, 2, 3)] == [0.001, 0.002, 0.0]
    assert result["a.mode"][0] == 2


@pytest.mark.parametrize(("fault", "status", "detail"), [
    (2, "discard", "(discard, computed up to 0.055 s)"), (3, "error", "(error)"), (4, "fatal", "(fatal)"),
])
def test_a_failing_step_names_component_time_and_reason(probe_fmu: Path, fault: int, status: str,
                                                        detail: str) -> None:
    parameters: dict[str, Any] = {"b.fault": fault, "b.fault_time": 0.05, "b.label": "100% of the left one"}
    with pytest.raises(StepError) as error:
        simulate(system(probe_fmu), parameters=parameters, stop_time=1.0)
    assert str(error.value) == (f"b: the step failed at t = 0.05 s {detail}: "
                                f"100% of the left one answers {fault} as it was told")
    assert (error.value.component, error.value.time, error.value.status) == ("b", 0.05, status)
    assert error.value.result is not None
    assert error.value.result.time.tolist() == [n * 0.01 for n in range(6)]
    assert not error.value.result.completed


@pytest.mark.parametrize("fault", [2, 3, 4])
def test_a_failing_initialisation_leaves_no_result(probe_fmu: Path, fault: int) -> None:
    with pytest.raises(StepError, match=r"^b: initialisation failed at t = 0 s .*answers") as error:
        simulate(system(probe_fmu), parameters={"b.initial_fault": fault}, stop_time=1.0)
    assert error.value.result is None


def test_nan_is_named(probe_fmu: Path) -> None:
    with pytest.raises(StepError, match=r"^a: x is not a number \(NaN\) at t = 0.06 s"):
        simulate(system(probe_fmu), parameters={"a.fault": 5, "a.fault_time": 0.05}, stop_time=1.0)


def test_warnings_do_not_stop_and_are_kept(probe_fmu: Path) -> None:
    result = simulate(system(probe_fmu), parameters={"b.fault": 1, "b.fault_time": 0.985}, stop_time=1.0)
    assert result.completed
    assert result.warnings == ("b: probe answers 1 as it was told",)


@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_warnings_are_counted_and_logged_once(probe_fmu: Path, caplog: pytest.LogCaptureFixture, engine: str) -> None:
    result = simulate(system(probe_fmu), parameters={"b.fault": 1}, stop_time=4.0, engine=engine)
    assert result.warnings == ("b: probe answers 1 as it was told (400 times)",)
    assert [record.getMessage() for record in caplog.records] == ["b: probe answers 1 as it was told"]


def test_an_fmu_that_does_not_instantiate_tells_why(make_fmu: Factory, tmp_path: Path) -> None:
    other = make_fmu(tmp_path / "Other.fmu", lambda text: text.replace('guid="probe"', 'guid="other"'))
    here = Path.cwd()
    with pytest.raises(StepError, match=r"a: Other.fmu cannot be instantiated: wrong guid other"):
        simulate(system(other), stop_time=1.0)
    broken = tmp_path / "Broken.fmu"
    with zipfile.ZipFile(other) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            target.writestr(name, source.read(name) if name.endswith(".xml") else b"no library")
    with pytest.raises(StepError, match=r"a: Broken.fmu cannot be instantiated: Failed to load"):
        simulate(system(broken), stop_time=1.0)
    assert Path.cwd() == here


@pytest.mark.parametrize(("old", "new", "message"), [
    (r'fmiVersion="2\.0"', 'fmiVersion="1.0"', "modelDescription.xml is not valid"),
    ("<CoSimulation[^>]*/>", '<ModelExchange modelIdentifier="probe"/>',
     "offers model exchange only; export it for co-simulation"),
    ('valueReference="0" causality="input"', 'causality="input"', "modelDescription.xml is not valid"),
    (r"<\?xml [^>]*>", '<!DOCTYPE a [<!ENTITY e "x">]>', "document type declaration"),
    ("</fmiModelDescription>", "", "is not XML"),
])
def test_what_is_not_an_fmi_2_slave_is_refused(make_fmu: Factory, tmp_path: Path, old: str, new: str,
                                               message: str) -> None:
    fmu = make_fmu(tmp_path / "Fmu.fmu", lambda text: re.sub(old, new, text))
    with pytest.raises(FmuError) as error:
        read_fmu(fmu)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_an_fmu_of_fmi_3_wants_its_own_folder_of_binaries(make_fmu: Factory, tmp_path: Path) -> None:
    text = ('<fmiModelDescription fmiVersion="3.0" modelName="Three" instantiationToken="3">'
            '<CoSimulation modelIdentifier="probe"/><ModelVariables>'
            '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>'
            "</ModelVariables><ModelStructure/></fmiModelDescription>")
    with pytest.raises(FmuError, match=r"holds no binary for \w+-\w+, only \w+64"):
        read_fmu(make_fmu(tmp_path / "Three.fmu", lambda _: text))


def test_an_fmu_for_another_platform_is_refused(tmp_path: Path, probe_fmu: Path) -> None:
    foreign = tmp_path / "Foreign.fmu"
    with zipfile.ZipFile(probe_fmu) as source, zipfile.ZipFile(foreign, "w") as target:
        target.writestr("modelDescription.xml", source.read("modelDescription.xml"))
        target.writestr("binaries/beos/probe.so", b"")
    with pytest.raises(FmuError, match=r"holds no binary for .*, nor for any other platform that"):
        read_fmu(foreign)
    with zipfile.ZipFile(tmp_path / "Empty.fmu", "w"):
        pass
    with pytest.raises(FmuError, match=r"holds no modelDescription\.xml"):
        read_fmu(tmp_path / "Empty.fmu")


def test_times_come_from_the_system_and_must_fit(probe_fmu: Path) -> None:
    result = simulate(system(probe_fmu, start_time=1.0, stop_time=1.5, step_size=0.125))
    assert result.time.tolist() == [1.0, 1.125, 1.25, 1.375, 1.5]
    with pytest.raises(CosimError, match="states no stop time"):
        simulate(system(probe_fmu))
    with pytest.raises(CosimError, match="does not divide"):
        simulate(system(probe_fmu), stop_time=1.0, step_size=0.3)


def test_what_to_record_is_checked(probe_fmu: Path) -> None:
    with pytest.raises(SystemStructureError, match=r"'a.y'.*'outs'|'outs'|and 1 more") as error:
        simulate(system(probe_fmu), stop_time=1.0, record=("a.y", "outs", "a.x"))
    assert len(error.value.problems) == 2
    result = simulate(system(probe_fmu), stop_time=0.01, record=["a.gain[1]", "b.fault*"])
    assert list(result) == ["a.gain[1]", "b.fault_time", "b.fault"]
    assert list(simulate(system(probe_fmu), stop_time=0.01, record="a.x")) == ["a.x"]


def test_errors_travel_between_processes(probe_fmu: Path) -> None:
    with pytest.raises(StepError) as error:
        simulate(system(probe_fmu), parameters={"a.fault": 3, "a.fault_time": 0.05}, stop_time=0.1)
    copy = pickle.loads(pickle.dumps(error.value))
    assert (str(copy), copy.component, copy.time) == (str(error.value), "a", 0.05)
    assert copy.result["b.x"].tolist() == [0.0] * 6
    assert str(pickle.loads(pickle.dumps(SimulationInterrupted(0.5)))) == "interrupted at t = 0.5 s"
    several = pickle.loads(pickle.dumps(SystemStructureError("one", "two")))
    assert (str(several), several.problems) == ("one (and 1 more problem)", ("one", "two"))


def test_nothing_is_left_behind(probe_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    simulate(system(probe_fmu), stop_time=0.1)
    with pytest.raises(StepError):
        simulate(system(probe_fmu), parameters={"a.fault": 4}, stop_time=0.1)
    with pytest.raises(SystemStructureError):
        simulate(system(probe_fmu), parameters={"a.falt": 4}, stop_time=0.1)
    assert list(tmp_path.iterdir()) == []


SSD = """<?xml version="1.0"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="ring">
<ssd:System name="ring"><ssd:Elements>
{components}
</ssd:Elements><ssd:Connections>
{connections}
</ssd:Connections></ssd:System></ssd:SystemStructureDescription>"""


def chain(path: Path, fmu: Path) -> Path:
    """a -> b -> c, listed backwards; written as an .ssp that FMPy reads too."""
    component = """<ssd:Component name="{0}" source="resources/Probe.fmu"><ssd:Connectors>
        <ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector>{1}</ssd:Connectors></ssd:Component>"""
    # FMPy joins an input connector that nothing feeds to the connection before: the first component lists none.
    entry = '<ssd:Connector name="u" kind="input"><ssc:Real/></ssd:Connector>'
    connection = '<ssd:Connection startElement="{0}" startConnector="x" endElement="{1}" endConnector="u"/>'
    text = SSD.format(components="\n".join(component.format(name, "" if name == "a" else entry) for name in "cba"),
                      connections="\n".join(connection.format(*pair) for pair in ("bc", "ab")))
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("SystemStructure.ssd", text)
        packed.write(fmu, "resources/Probe.fmu")
    return path


def test_the_same_bits_as_fmpys_master_but_for_its_delays(probe_fmu: Path, tmp_path: Path) -> None:
    """FMPy is a Jacobi master: every link delays by a step, inputs begin at 0.0, and rows lack the initial values.

    So its row n is our row n + 1 of the first component, our row n of the second, and our row n - 1 of the third. The
    step is a power of two, as FMPy adds up time.
    """
    path = chain(tmp_path / "chain.ssp", probe_fmu)
    ours = simulate(path, parameters={"a.start_x": 1.0}, stop_time=1.0, step_size=1.0 / 64.0)
    values = ParameterSet(parameters=[Parameter(name="a.start_x", type="Real", value="1.0")])
    theirs = simulate_ssp(str(path), stop_time=1.0, step_size=1.0 / 64.0, parameter_set=values)
    assert ours.order == ("a", "b", "c")
    assert ours["c.x"][-1] > 0.1
    assert theirs["a.x"].tolist() == ours["a.x"][1:].tolist()
    assert theirs["b.x"].tolist() == ours["b.x"][:-1].tolist()
    assert theirs["c.x"][1:].tolist() == ours["c.x"][:-2].tolist()


def test_ctrl_c_during_a_real_run(probe_fmu: Path) -> None:
    def press(done: int, steps: int) -> None:
        if done > 100:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(SimulationInterrupted) as error:
        simulate(system(probe_fmu), stop_time=1e6, step_size=1.0, progress=press)
    assert error.value.result is not None
    assert error.value.result.steps > 100
    assert error.value.result.time[-1] == error.value.time


def test_runs_in_another_thread(probe_fmu: Path) -> None:
    rows: list[int] = []
    thread = threading.Thread(
        target=lambda: rows.append(len(simulate(system(probe_fmu), stop_time=0.1).time)))
    thread.start()
    thread.join()
    assert rows == [11]
