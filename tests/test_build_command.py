"""``threadpitch build``: FMUs without fault and an .ssp with equal bytes, which runs like the folder it came from."""

from __future__ import annotations

import contextlib
import io
import shutil
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.ssp.ssd import read_ssd, read_ssv
from fmpy.validation import validate_fmu

from tests.fmu.own import write_model
from tests.plain_system import read_plan
from threadpitch import cosim, lathe
from threadpitch.cli import invoke
from threadpitch.system_archive import FmuKind, build_system

FMUS = {"FeedDrive.fmu", "PitchCalculator.fmu", "SpindleDrive.fmu", "ThreadCutting.fmu", "ThreadingController.fmu"}
SSP = "threading_lathe.ssp"


@dataclass(frozen=True)
class Told:
    """A build of all, and what it printed."""

    folder: Path
    out: str
    err: str


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Told:
    folder = tmp_path_factory.mktemp("built") / "new" / "folder"
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        assert invoke(["build", "--output", str(folder)]) == 0
    return Told(folder, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def built(build: Told) -> Path:
    return build.folder


def test_it_writes_every_model_and_the_lathe_and_names_them(build: Told) -> None:
    expected = {f"{lathe_class(path)}.fmu" for path in lathe.model_files()} | {SSP}
    assert expected >= FMUS
    assert {path.name for path in build.folder.iterdir()} == expected  # and nothing temporary
    assert {Path(line) for line in build.out.splitlines()} == set(build.folder.iterdir())
    assert build.err == ""


def lathe_class(path: Path) -> str:
    return "".join(word.capitalize() for word in path.stem.split("_"))


def test_a_named_model_is_built_alone(tmp_path: Path) -> None:
    assert invoke(["build", str(lathe.model_file("PitchCalculator")), "--output", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["PitchCalculator.fmu"]


def test_two_models_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = write_model(tmp_path / "a.py", "self.n = 1"), write_model(tmp_path / "b.py", "self.n = 2")
    assert invoke(["build", str(first), str(second), "--output", str(tmp_path / "fmus")]) == 2
    assert (f"{second}: the model Probe is in {first} too, and both would be written to Probe.fmu; rename one"
            in capsys.readouterr().err)
    assert not (tmp_path / "fmus").exists()
    assert invoke(["build", str(first), str(first), "--output", str(tmp_path / "fmus")]) == 0


def test_fmpy_finds_no_fault_in_any_fmu(built: Path) -> None:
    found = sorted(built.glob("*.fmu"))
    assert {path.name for path in found} >= FMUS
    for path in found:
        assert validate_fmu(str(path)) == [], path.name
        assert read_model_description(str(path)).coSimulation.modelIdentifier == path.stem


def test_equal_input_gives_equal_bytes(built: Path, tmp_path: Path) -> None:
    assert invoke(["build", "--output", str(tmp_path)]) == 0
    for path in built.iterdir():
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


def test_the_ssp_holds_the_fmus_that_it_names_and_values_in_their_units(built: Path) -> None:
    path = built / SSP
    plan = read_plan()
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        for name in FMUS:
            assert archive.read(f"resources/{name}") == (built / name).read_bytes(), name
    assert names == {"SystemStructure.ssd", *(f"resources/{name}" for name in FMUS),
                     *(f"resources/parameters/{component}.ssv" for component in plan.order)}
    read_ssd(str(path))  # valid against the schema
    stated: dict[str, str] = {}
    for component in plan.order:
        values = read_ssv(str(path), f"resources/parameters/{component}.ssv")
        assert values.name == "threading_lathe"  # one name, so that a tool can choose all sets by it
        assert all(parameter.unit is None for parameter in values.parameters)
        stated |= {f"{component}.{parameter.name}": parameter.value for parameter in values.parameters}
    assert stated == {f"{one.component}.{one.variable.name}": str(one.value).lower() for one in plan.settings}
    assert stated["controller.lead"] == "0.0015"


def test_every_input_connector_of_the_ssp_is_fed(built: Path) -> None:
    system = read_ssd(str(built / SSP)).system
    fed = {(one.endElement, one.endConnector) for one in system.connections}
    inputs = {(element.name, connector.name) for element in system.elements for connector in element.connectors
              if connector.kind == "input"}
    assert inputs == fed


def test_the_ssp_runs_with_the_bits_of_the_folder(built: Path, tmp_path: Path) -> None:
    for name, system in (("folder", []), ("ssp", [str(built / SSP)])):
        status = invoke(["run", *system, "--stop-time", "1.5", "--output", str(tmp_path / name), "--start-angle", "0",
                         "120"])
        assert status == 0
    for name in ("trace.csv", "pitch.csv", "tables.txt"):
        assert (tmp_path / "ssp" / name).read_bytes() == (tmp_path / "folder" / name).read_bytes(), name


def test_the_ssp_runs_where_no_model_is_at_hand(built: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = lathe.simulate(stop_time=1.0)

    def absent(*_: object) -> Path:
        raise AssertionError("an FMU was built although the .ssp holds it")

    monkeypatch.setattr(lathe, "cached_fmu", absent)
    result = lathe.simulate(built / SSP, stop_time=1.0)
    assert set(result) == set(expected)
    for name in expected:
        assert np.array_equal(result[name], expected[name]), name


def test_bindings_of_components_and_foreign_files_are_packed_too(tmp_path: Path) -> None:
    """A folder with a set of its own at a component, overridden by the system's: one set with the winning values."""
    source = tmp_path / "other"
    shutil.copytree(lathe.find_system(lathe.DEFAULT_SYSTEM), source)
    (source / "resources" / "notes.txt").write_text("kept", encoding="utf-8")
    (source / "own.ssv").write_text(
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
        'name="own"><ssv:Parameters><ssv:Parameter name="inertia"><ssv:Real value="0.7"/></ssv:Parameter>'
        '<ssv:Parameter name="viscous_friction"><ssv:Real value="0.03"/></ssv:Parameter></ssv:Parameters>'
        "</ssv:ParameterSet>", encoding="utf-8")
    structure = source / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8")
    place = "</ssd:Connectors>"  # the first component is the spindle
    structure.write_text(text.replace(place, f'{place}<ssd:ParameterBindings><ssd:ParameterBinding source="own.ssv"/>'
                                             "</ssd:ParameterBindings>", 1), encoding="utf-8")
    path = build_system(source, tmp_path, FmuKind(lathe.choose_flavor()))
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
    assert "resources/notes.txt" in names
    assert {name for name in names if name.endswith(".ssv")} == {
        f"resources/parameters/{component}.ssv" for component in read_plan().order}
    values = {one.name: float(one.value) for one in read_ssv(str(path), "resources/parameters/spindle.ssv").parameters}
    assert values["inertia"] == 0.15  # SSP 1.0: the system's value overrides the component's
    assert values["viscous_friction"] == 0.03
    settings = {(one.component, one.variable.name): one.value for one in read_plan(path).settings}
    assert settings == {(one.component, one.variable.name): one.value for one in read_plan(source).settings}


def test_the_ssp_tells_omsimulator_its_master_and_keeps_what_others_noted(tmp_path: Path) -> None:
    """As OMSimulator 2 and 3 look for it: the first annotation, ``oms:Annotations``, one element with both forms."""
    source = tmp_path / "noted"
    shutil.copytree(lathe.find_system(lathe.DEFAULT_SYSTEM), source)
    ssd = source / "SystemStructure.ssd"
    note = ('<ssd:Annotations><ssc:Annotation type="com.example"><note xmlns="urn:example">left</note></ssc:Annotation>'
            "</ssd:Annotations>")
    ssd.write_text(ssd.read_text(encoding="utf-8").replace("</ssd:System>", f"{note}</ssd:System>"), encoding="utf-8")
    path = build_system(source, tmp_path / "out", FmuKind(lathe.choose_flavor()))
    with cosim.read_system(path) as structure:  # keeps the schema
        assert structure.step_size == 1e-3
        assert [(found.owner, found.type) for found in structure.annotations] == [
            ("", "org.openmodelica"), ("", "com.example"), ("DefaultExperiment", "org.openmodelica")]
        master, other, experiment = (found.content for found in structure.annotations)
    assert 'oms:SimulationInformation name="oms_ma_default" method="oms_ma" fixedStepSize="0.001"' in master
    assert '<oms:FixedStepMaster description="oms-ma" stepSize="0.001"' in master
    assert ">left</" in other
    assert 'resultFile="threading_lathe_res.mat"' in experiment
