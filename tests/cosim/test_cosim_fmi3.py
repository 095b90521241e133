"""FMUs of FMI 3.0: types, arrays, connections with FMI 2.0, failures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from threadpitch.cosim import StepError, SystemStructureError, simulate
from threadpitch.cosim.description import read_fmu
from threadpitch.cosim.system import Component, Connection, System, Table

Factory = Callable[..., Path]
engines = pytest.mark.parametrize("engine", ["python", "kernel"])
WHOLE = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")


def system(*connections: Connection, **fmus: Path) -> System:
    return System("probes", tuple(Component(name, fmu) for name, fmu in fmus.items()), connections)


def test_the_description_lists_elements_types_and_abilities(probe3_fmu: Path) -> None:
    fmu = read_fmu(probe3_fmu)
    assert (fmu.fmi, fmu.guid, fmu.step_size) == (3, "probe3", 0.01)
    assert [found.name for found in fmu.arrays["w"]] == ["w[1]", "w[2]", "w[3]"]
    assert [found.start for found in fmu.arrays["w"]] == [0.0, 0.5, 1.0]
    assert [found.name for found in fmu.arrays["a"]][:4] == ["a[1,1]", "a[1,2]", "a[1,3]", "a[2,1]"]
    last = fmu.variables["a[3,3]"]
    assert (last.reference, last.element, last.size, last.start) == (5, 8, 9, 1.0)
    assert fmu.variables["mode"].choices == {"slow": 1, "fast": 2}
    assert fmu.variables["mode"].c_type == "fmi3Int64"
    assert [found.name for found in fmu.variables.values() if found.interpolated] == ["u", "w[1]", "w[2]", "w[3]"]
    assert fmu.variables["tick"].type == "Clock"
    assert not fmu.variables["tick"].exchanged


@engines
def test_values_of_every_type_travel_and_are_recorded(probe3_fmu: Path, engine: str) -> None:
    links = [Connection("a", f"{name}_out", "b", f"{name}_in") for name in WHOLE]
    links += [Connection("a", "x", "b", "u"), Connection("a", "single_out", "b", "single_in"),
              Connection("a", "truth_out[2]", "b", "truth_in[1]"), Connection("a", "v[3]", "b", "w[1]"),
              Connection("a", "v[1]", "b", "w[3]")]
    result = simulate(system(*links, a=probe3_fmu, b=probe3_fmu), stop_time=2.0, engine=engine, record=("*",),
                      parameters={"a.u": 1.0, "a.single_in": 0.1, "a.truth_in": [True, False]})
    for name in WHOLE:
        taken, given = result[f"b.{name}_in"], result[f"a.{name}_out"]
        assert taken.dtype == np.dtype(name)
        assert taken.tolist() == given.tolist()
        n = np.arange(201)
        assert given[1:].tolist() == (3 + n[1:].astype(np.uint64)).astype(name).tolist()
        expected = (3 * given[1:].astype(np.uint64) + n[1:].astype(np.uint64)).astype(name)
        assert result[f"b.{name}_out"][1:].tolist() == expected.tolist()
    assert result["a.single_out"].dtype == np.float32
    assert result["a.single_out"][-1] == pytest.approx(0.2, rel=1e-6)
    assert result["b.single_in"].tolist() == result["a.single_out"].tolist()
    assert result["b.truth_in[1]"].tolist() == result["a.truth_out[2]"].tolist()
    assert result["b.truth_in[1]"].dtype == np.bool_
    # v = 2 (w + a1 - a3) at rest; the element of w that is not fed keeps its start value
    assert result["a.v[2]"][-1] == pytest.approx(2.0 * (0.5 + 0.375 - 0.625))
    assert result["b.w[1]"].tolist() == result["a.v[3]"].tolist()
    assert result["b.w[2]"].tolist() == [0.5] * 201
    assert result["b.w[3]"].tolist() == result["a.v[1]"].tolist()
    assert result["a.x"][-1] == pytest.approx(1.0 - 0.99**200)


@engines
def test_fmi_2_and_fmi_3_are_joined(probe_fmu: Path, probe3_fmu: Path, engine: str) -> None:
    joined = system(
        Connection("two", "x", "three", "w[2]"), Connection("two", "twice", "three", "u", factor=0.5, offset=0.25),
        Connection("two", "count", "three", "int64_in"), Connection("two", "flag_out", "three", "truth_in[2]"),
        Connection("two", "x", "three", "single_in"), Connection("three", "v[2]", "last", "u"),
        Connection("three", "int16_out", "last", "number"), Connection("three", "truth_out[1]", "last", "flag"),
        two=probe_fmu, three=probe3_fmu, last=probe_fmu)
    result = simulate(joined, stop_time=0.5, engine=engine, record=("*",),
                      parameters={"two.start_x": 1.0, "two.flag": True, "two.u": 0.5, "three.mode": "fast"})
    assert result["three.w[2]"].tolist() == result["two.x"].tolist()
    assert result["three.u"].tolist() == (result["two.twice"] * 0.5 + 0.25).tolist()
    assert result["three.int64_in"].tolist() == list(range(51))
    assert result["three.single_in"].tolist() == result["two.x"].astype(np.float32).tolist()
    assert result["three.truth_in[2]"].all()
    assert result["last.flag_out"][1:].all()
    assert not result["last.flag_out"][0]
    assert result["last.number_out"].tolist() == result["three.int16_out"].tolist()
    assert result["last.u"].tolist() == result["three.v[2]"].tolist()
    assert set(result["three.mode"].tolist()) == {2}


@pytest.mark.parametrize(("start", "end", "message"), [
    ("x", "int32_in", "joins Float64 to Int32; both must be the same"),
    ("int64_out", "int32_in", "joins Int64 to Int32, which does not hold all of its values"),
    ("int8_out", "uint16_in", "joins Int8 to UInt16, which does not hold all of its values"),
    ("truth_out[1]", "u", "joins Boolean to Float64"),
    ("v", "u", "joins 3 values to 1; arrays must have equal sizes"),
])
def test_what_does_not_fit_is_refused(probe3_fmu: Path, start: str, end: str, message: str) -> None:
    with pytest.raises(SystemStructureError) as error:
        simulate(system(Connection("a", start, "b", end), a=probe3_fmu, b=probe3_fmu), stop_time=1.0)
    assert message in str(error.value)


@pytest.mark.parametrize(("start", "end"), [("uint8_out", "int16_in"), ("uint32_out", "int64_in"),
                                            ("int8_out", "int32_in"), ("single_out", "u"), ("x", "single_in")])
@engines
def test_what_fits_is_converted(probe3_fmu: Path, engine: str, start: str, end: str) -> None:
    joined = system(Connection("a", start, "b", end), a=probe3_fmu, b=probe3_fmu)
    result = simulate(joined, stop_time=2.0, engine=engine, record=(f"a.{start}", f"b.{end}"),
                      parameters={"a.u": 0.1, "a.single_in": 0.1, "a.int8_in": -100, "a.uint32_in": 3 * 10**9})
    assert result[f"b.{end}"].tolist() == result[f"a.{start}"].astype(result[f"b.{end}"].dtype).tolist()


@pytest.mark.parametrize(("name", "given", "message"), [
    ("a.uint8_in", 256, "256 does not fit into 8 bits without sign"), ("a.int8_in", -129, "does not fit into 8 bits"),
    ("a.int64_in", 2**63, "does not fit into 64 bits"), ("a.uint64_in", "-1", "does not fit into 64 bits without sign"),
    ("a.w", [0.0] * 4, "4 values for an array of 3"), ("a.tick", 1, "the variable is Clock"),
    ("a.uint64_in", 10**400, "does not fit"), ("a.fault", 7, "above the maximum"),
])
def test_values_that_do_not_fit(probe3_fmu: Path, name: str, given: Any, message: str) -> None:
    with pytest.raises(SystemStructureError) as error:
        simulate(system(a=probe3_fmu), parameters={name: given}, stop_time=1.0)
    assert message in str(error.value)


def test_whole_numbers_of_64_bits_are_kept(probe3_fmu: Path) -> None:
    for given in (2**64 - 1, str(2**64 - 1)):
        result = simulate(system(a=probe3_fmu), parameters={"a.uint64_in": given, "a.int64_in": -(2**63)},
                          stop_time=0.01, record=("inputs",))
        assert result["a.uint64_in"].tolist() == [2**64 - 1] * 2
        assert result["a.int64_in"].tolist() == [-(2**63)] * 2


@pytest.mark.parametrize(("fault", "status", "message"), [
    (2, "discard", "(discard, computed up to 0.055 s): 100% answers 2 as it was told"),
    (3, "error", "(error): 100% answers 3 as it was told"), (4, "fatal", "(fatal): 100% answers 4 as it was told"),
    (6, "discard", "(discard, computed up to 0.055 s): the FMU asks to end the run"),
])
@engines
def test_a_failing_step_names_component_time_and_reason(probe3_fmu: Path, engine: str, fault: int, status: str,
                                                        message: str) -> None:
    with pytest.raises(StepError) as error:
        simulate(system(a=probe3_fmu, b=probe3_fmu), stop_time=1.0, engine=engine,
                 parameters={"b.fault": fault, "b.fault_time": 0.05, "b.label": "100%"})
    assert str(error.value) == f"b: the step failed at t = 0.05 s {message}"
    assert (error.value.component, error.value.time, error.value.status) == ("b", 0.05, status)
    assert error.value.result is not None
    assert error.value.result.steps == 5


@engines
def test_nan_and_warnings(probe3_fmu: Path, engine: str) -> None:
    with pytest.raises(StepError, match=r"^a: x is not a number \(NaN\) at t = 0.06 s"):
        simulate(system(a=probe3_fmu), parameters={"a.fault": 5, "a.fault_time": 0.05}, stop_time=1.0, engine=engine)
    result = simulate(system(a=probe3_fmu), parameters={"a.fault": 1, "a.fault_time": 0.985}, stop_time=1.0)
    assert result.warnings == ("a: probe3 answers 1 as it was told",)


def test_an_fmu_that_does_not_instantiate_tells_why(make_fmu3: Factory, tmp_path: Path) -> None:
    other = make_fmu3(tmp_path / "Other.fmu", lambda text: text.replace('Token="probe3"', 'Token="other"'))
    with pytest.raises(StepError, match=r"a: Other.fmu cannot be instantiated: wrong token"):
        simulate(system(a=other), stop_time=1.0)


@engines
def test_tables_of_values_are_looked_up(probe_fmu: Path, probe3_fmu: Path, engine: str) -> None:
    """Both engines map whole numbers of any width, and truth values of both FMI versions; the rest stays."""
    numbers, truth = Table("Integer", (("-3", "5"), ("7", "-3"))), Table("Boolean", (("true", "false"), ("0", "1")))
    wide = Table("Integer", ((str(2**63 + 10), str(2**64 - 1)),))
    joined = system(Connection("a", "int8_out", "b", "int16_in", table=numbers),
                    Connection("a", "uint64_out", "b", "uint64_in", table=wide),
                    Connection("a", "truth_out[1]", "b", "truth_in[1]", table=truth),
                    Connection("a", "truth_out[1]", "c", "flag", table=truth),
                    Connection("c", "flag_out", "b", "truth_in[2]", table=truth), a=probe3_fmu, b=probe3_fmu,
                    c=probe_fmu)
    result = simulate(joined, stop_time=1.0, engine=engine, record=("inputs", "outputs"),
                      parameters={"a.int8_in": -3, "a.uint64_in": 2**63 + 1})
    given = result["a.int8_out"].astype(int).tolist()
    assert result["b.int16_in"].tolist()[1:] == [{-3: 5, 7: -3}.get(value, value) for value in given[1:]]
    wide_given = result["a.uint64_out"].tolist()
    assert {-3, 7} <= set(given)
    assert 2**63 + 10 in wide_given
    assert result["b.uint64_in"].tolist()[1:] == [{2**63 + 10: 2**64 - 1}.get(value, value) for value in wide_given[1:]]
    assert (result["b.truth_in[1]"] != result["a.truth_out[1]"])[1:].all()
    assert (result["c.flag"] != result["a.truth_out[1]"])[1:].all()
    assert (result["b.truth_in[2]"] != result["c.flag_out"])[1:].all()
