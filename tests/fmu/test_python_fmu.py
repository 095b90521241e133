"""The PythonFMU FMUs in FMPy: refusals, messages, state, several in one process, and their archives."""

from __future__ import annotations

import itertools
import math
import random
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

from tests.fmu.driving import MODEL_PATHS, TEST_MODEL, Fmu, names, opened, random_inputs, read
from threadpitch.fmu import build_python_fmu, scalars

Build = Callable[[Path], Path]
every_model = pytest.mark.parametrize("path", MODEL_PATHS, ids=names(MODEL_PATHS))


@every_model
def test_validation_reports_nothing(path: Path, python_fmu: Build) -> None:
    assert validate_fmu(str(python_fmu(path))) == []


@every_model
def test_building_twice_gives_the_same_bytes(path: Path, python_fmu: Build, tmp_path: Path) -> None:
    assert build_python_fmu(read(path), tmp_path).read_bytes() == python_fmu(path).read_bytes()


@every_model
def test_archive_holds_what_an_fmu_needs(path: Path, python_fmu: Build) -> None:
    model = read(path)
    with zipfile.ZipFile(python_fmu(path)) as archive:
        held = set(archive.namelist())
        assert archive.read("model.png").startswith(b"\x89PNG")
        page = archive.read("documentation/index.html").decode()
        script = archive.read("resources/slavemodule.txt").decode()
        assert b"Permission is hereby granted" in archive.read("documentation/licenses/pythonfmu-LICENSE.txt")
        assert b"import threadpitch" not in archive.read(f"resources/{script}.py")
        assert b"from threadpitch" not in archive.read(f"resources/{script}.py")
    assert {"modelDescription.xml", f"resources/{script}.py", "resources/pythonfmu/fmi2slave.py",
            f"binaries/linux64/{model.class_name}.so", f"binaries/win64/{model.class_name}.dll"} <= held
    assert all(variable.name in page for variable in model.variables)


def _outside(variable: object, limit: float | int, away: float) -> float | int:
    if isinstance(limit, int):
        return limit + (1 if away > 0 else -1)
    return math.nextafter(limit, away)


@every_model
def test_every_parameter_outside_its_range_is_refused_by_name(path: Path, python_fmu: Build) -> None:
    model = read(path)
    bad: list[tuple[str, float | int]] = []
    infinite = itertools.cycle((math.inf, -math.inf))
    for scalar in scalars(model):
        variable = scalar.variable
        if variable.causality != "parameter" or scalar.index not in (None, 1):
            continue
        if variable.kind == "float":
            bad += [(scalar.name, value) for value in (math.nan, next(infinite))]
        if variable.min is not None and variable.min > -(2**31):
            bad.append((scalar.name, _outside(variable, variable.min, -math.inf)))
        if variable.max is not None and variable.max < 2**31 - 1:
            bad.append((scalar.name, _outside(variable, variable.max, math.inf)))
    assert bad
    for name, value in bad:
        with opened(python_fmu(path), model) as fmu:
            with pytest.raises(FMICallException, match="fatal"):
                fmu.initialize({name: value})
            assert f"parameter {name} is " in fmu.log[-1], (name, value)


@every_model
def test_inputs_that_are_not_finite_fail_the_step_and_change_nothing(path: Path, python_fmu: Build) -> None:
    model = read(path)
    generator = random.Random(3)
    with opened(python_fmu(path), model) as fmu:
        fmu.initialize()
        for number, values in enumerate(random_inputs(model, 5, generator)):
            fmu.step(number, values)
        for scalar in scalars(model):
            if scalar.variable.causality != "input" or scalar.variable.kind != "float":
                continue
            good = fmu.get(scalar.name)
            for value in (math.nan, math.inf, -math.inf):
                fmu.put(scalar.name, value)
                before = fmu.everything()
                with pytest.raises(FMICallException, match="discard"):
                    fmu.step(5)
                assert f"input {scalar.name} is " in fmu.log[-1]
                assert fmu.everything() == before
            fmu.put(scalar.name, good)
        before = fmu.everything()
        fmu.step(5, random_inputs(model, 6, generator)[-1])
        assert fmu.everything() != before


@every_model
def test_state_restores_every_bit(path: Path, python_fmu: Build) -> None:
    model = read(path)
    generator = random.Random(path.stem)
    inputs = random_inputs(model, 40, generator)
    saved_at = generator.randrange(5, 20)
    with opened(python_fmu(path), model) as fmu, opened(python_fmu(path), model) as other:
        fmu.initialize()
        for number in range(saved_at):
            fmu.step(number, inputs[number])
        state = fmu.slave.getFMUstate()
        serialized = fmu.slave.serializeFMUstate(state)
        saved = fmu.everything()
        first = _run_on(fmu, saved_at, inputs)
        fmu.slave.setFMUstate(state)
        assert fmu.everything() == saved
        assert _run_on(fmu, saved_at, inputs) == first
        other.slave.setFMUstate(other.slave.deSerializeFMUstate(serialized))
        assert other.everything() == saved
        assert _run_on(other, saved_at, inputs) == first
        fmu.slave.freeFMUstate(state)


def _run_on(fmu: Fmu, start: int, inputs: list[dict[str, float | int | bool]]) -> list[dict[str, str]]:
    rows = []
    for number in range(start, len(inputs)):
        fmu.step(number, inputs[number])
        rows.append(fmu.everything())
    return rows


@every_model
def test_reset_starts_again(path: Path, python_fmu: Build) -> None:
    model = read(path)
    inputs = random_inputs(model, 5, random.Random(1))
    with opened(python_fmu(path), model) as fmu:
        fmu.initialize()
        first = _run_on(fmu, 0, inputs)
        fmu.slave.reset()
        fmu.slave.setupExperiment(startTime=0.0)
        fmu.initialize()
        assert _run_on(fmu, 0, inputs) == first


def test_instances_and_models_in_one_process_do_not_mix(python_fmu: Build) -> None:
    paths = [TEST_MODEL, TEST_MODEL, *MODEL_PATHS[1:3]]
    alone = []
    for path in paths:
        with opened(python_fmu(path), read(path)) as fmu:
            fmu.initialize()
            alone.append(_run_on(fmu, 0, random_inputs(read(path), 10, random.Random(2))))
    with (opened(python_fmu(paths[0]), read(paths[0])) as a, opened(python_fmu(paths[1]), read(paths[1])) as b,
          opened(python_fmu(paths[2]), read(paths[2])) as c, opened(python_fmu(paths[3]), read(paths[3])) as d):
        fmus = [a, b, c, d]
        inputs = [random_inputs(read(path), 10, random.Random(2)) for path in paths]
        together: list[list[dict[str, str]]] = [[], [], [], []]
        for fmu in fmus:
            fmu.initialize()
        for number in range(10):
            for place, fmu in enumerate(fmus):
                fmu.step(number, inputs[place][number])
                together[place].append(fmu.everything())
    assert together == alone


def test_changed_model_of_the_same_name_runs_its_own_code(tmp_path: Path, python_fmu: Build) -> None:
    changed = tmp_path / "damped_mass.py"
    changed.write_text(TEST_MODEL.read_text().replace("self.base - position", "3.0 * (self.base - position)"))
    other = build_python_fmu(read(changed), tmp_path)
    results = []
    for path, source in ((python_fmu(TEST_MODEL), TEST_MODEL), (other, changed)):
        with opened(path, read(source)) as fmu:
            fmu.initialize()
            fmu.step(0, {"base": 1e-3})
            results.append(fmu.get("position"))
    assert results[1] == pytest.approx(3.0 * float(results[0]), rel=0.1)


def test_get_in_initialization_mode_evaluates_initialize(python_fmu: Build) -> None:
    with opened(python_fmu(TEST_MODEL), read(TEST_MODEL)) as fmu:
        fmu.slave.enterInitializationMode()
        assert fmu.get("position") == 0.0
        for base in (0.25, 0.5):
            fmu.put("base", base)
            assert fmu.get("position") == base
        fmu.put("mass", -1.0)
        fmu.put("base", 0.75)
        assert fmu.get("position") == 0.5  # cannot be evaluated until the mass is mended
        fmu.put("mass", 1.0)
        assert fmu.get("history[4]") == 0.75
        fmu.slave.exitInitializationMode()


def test_declared_errors_are_said_and_change_nothing(python_fmu: Build) -> None:
    model = read(TEST_MODEL)
    with opened(python_fmu(TEST_MODEL), model) as fmu:
        with pytest.raises(FMICallException, match="fatal"):
            fmu.initialize({f"weights[{place}]": 0.0 for place in (1, 2, 3)})
        assert model.errors[2] in fmu.log[-1]
    with opened(python_fmu(TEST_MODEL), model) as fmu:
        fmu.initialize()
        fmu.step(0, {"base": 0.1})
        fmu.put("base", 1e9)
        before = fmu.everything()
        with pytest.raises(FMICallException, match="discard"):
            fmu.step(1)
        assert model.errors[1] in fmu.log[-1]
        assert fmu.everything() == before
        fmu.step(1, {"base": 0.1})


def test_count_beyond_32_bits_fails_the_step(python_fmu: Build) -> None:
    with opened(python_fmu(TEST_MODEL), read(TEST_MODEL)) as fmu:
        fmu.initialize()
        state = fmu.slave.getFMUstate()
        text = fmu.slave.serializeFMUstate(state).replace(b'"steps": 0', b'"steps": 2147483647')
        fmu.slave.setFMUstate(fmu.slave.deSerializeFMUstate(text))
        assert fmu.get("steps") == 2**31 - 1
        with pytest.raises(FMICallException, match="discard"):
            fmu.step(0)
        assert "steps is 2147483648, beyond the 32 bits" in fmu.log[-1]


@pytest.mark.parametrize(("name", "value", "message"), [
    ("mass", 1.5, "parameter mass is fixed in step mode"),
    ("weights[2]", 1.5, "parameter weights[2] is fixed in step mode"),
    ("position", 1.0, "position is calculated by the model"),
    ("velocity", 1.0, "velocity is calculated by the model"),
])
def test_what_cannot_be_set_is_refused_by_name(name: str, value: float, message: str, python_fmu: Build) -> None:
    with opened(python_fmu(TEST_MODEL), read(TEST_MODEL)) as fmu:
        fmu.initialize()
        with pytest.raises(FMICallException, match="fatal"):
            fmu.put(name, value)
        assert message in fmu.log[-1]


def test_wrong_state_and_wrong_call_are_refused(python_fmu: Build) -> None:
    model = read(TEST_MODEL)
    with opened(python_fmu(TEST_MODEL), model) as fmu:
        with pytest.raises(FMICallException, match="discard"):
            fmu.step(0)
        assert "exit initialization mode first" in fmu.log[-1]
        fmu.initialize()
        with pytest.raises(FMICallException, match="discard"):
            fmu.slave.doStep(0.0, 0.0)
        for text in (b"{}", b"no json", b'{"content": "other", "mode": "", "stale": false, "fields": {}}'):
            with opened(python_fmu(TEST_MODEL), model) as other:
                with pytest.raises(FMICallException, match="fatal"):
                    other.slave.setFMUstate(other.slave.deSerializeFMUstate(text))
                assert "belongs to another model" in other.log[-1]


def test_percent_signs_do_not_reach_the_printf_of_an_importer(tmp_path: Path) -> None:
    changed = tmp_path / "damped_mass.py"
    changed.write_text(TEST_MODEL.read_text().replace("must not all be zero", "are 0 %s of the whole"))
    model = read(changed)
    with opened(build_python_fmu(model, tmp_path), model) as fmu:
        with pytest.raises(FMICallException, match="fatal"):
            fmu.initialize({f"weights[{place}]": 0.0 for place in (1, 2, 3)})
        assert "%" not in fmu.log[-1]
        assert "percents of the whole" in fmu.log[-1]
