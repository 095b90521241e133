"""The dataclass and the native FMUs of FMI 2.0 and 3.0 calculate the same bits, every variable at every step."""

from __future__ import annotations

import random
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from tests.fmu.driving import (
    TABLE_MODEL,
    Fmu,
    Fmu3,
    advanced,
    opened,
    opened3,
    random_inputs,
    random_parameters,
    read,
    run_fmu,
    run_python,
)
from tests.fmu.native.building import both_versions, built, every_model, needs_compiler
from tests.fmu.native.expressions import model_text
from threadpitch.fmu import build_fmu

pytestmark = needs_compiler
STEPS = 150


def _opened(path: Path, fmi: int) -> AbstractContextManager[Fmu | Fmu3]:
    model = read(path)
    return opened(built(path), model) if fmi == 2 else opened3(built(path, 3), model)


@every_model
@both_versions
@pytest.mark.parametrize("seed", range(3))
def test_native_fmu_equals_dataclass(path: Path, fmi: int, seed: int) -> None:
    model = read(path)
    generator = random.Random(seed)
    parameters = random_parameters(model, generator)
    inputs = random_inputs(model, STEPS, generator)
    expected = run_python(model, model.model_class(), parameters, inputs)
    with _opened(path, fmi) as fmu:
        assert run_fmu(fmu, parameters, inputs) == expected


@every_model
@both_versions
def test_two_instances_beside_each_other(path: Path, fmi: int) -> None:
    model = read(path)
    generator = random.Random(11)
    jobs = [(random_parameters(model, generator), random_inputs(model, 20, generator)) for _ in range(2)]
    expected = [run_python(model, model.model_class(), *job) for job in jobs]
    with _opened(path, fmi) as first, _opened(path, fmi) as second:
        fmus, done = (first, second), [0, 0]
        for fmu, (parameters, _) in zip(fmus, jobs, strict=True):
            fmu.initialize(parameters)
        for number in range(20):
            for place, (_, inputs) in enumerate(jobs):
                done[place] = advanced(fmus[place], done[place], inputs[number])
                assert fmus[place].everything() == expected[place][number + 1]


@pytest.mark.parametrize("seed", [1, 2])
def test_random_expressions_keep_their_bits_in_c(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "expressions.py"
    path.write_text(model_text(seed))
    model = read(path)
    generator = random.Random(seed)
    inputs = [{"a": generator.gauss(0.0, 2.0), "b": generator.gauss(0.0, 1.0), "c": generator.uniform(-9.0, 9.0),
               "k": generator.randrange(-100, 100), "m": generator.randrange(-100, 100)} for _ in range(20)]
    expected = run_python(model, model.model_class(), {}, list(inputs))
    with opened(build_fmu(path, tmp_path, "native"), model) as fmu:
        assert run_fmu(fmu, {}, list(inputs)) == expected
    assert len({value for row in expected for value in row.values()}) > 500


@both_versions
def test_an_index_outside_its_array_fails_the_step_and_not_the_process(fmi: int) -> None:
    model = read(TABLE_MODEL)
    inputs = random_inputs(model, 5, random.Random(0))
    expected = run_python(model, model.model_class(), {"slot": 7}, inputs)
    assert expected[1] == expected[0] | {name: value for name, value in expected[1].items() if name in inputs[0]}
    with _opened(TABLE_MODEL, fmi) as fmu:
        assert run_fmu(fmu, {"slot": 7}, inputs) == expected
        assert "an index is outside its array: a fault of the model" in fmu.log[-1]


@both_versions
def test_a_declared_error_is_said_in_its_words(fmi: int) -> None:
    model = read(TABLE_MODEL)
    inputs = [{"speed_command": 1e6}] * 3
    expected = run_python(model, model.model_class(), {"limit": 2.0}, list(inputs))
    with _opened(TABLE_MODEL, fmi) as fmu:
        assert run_fmu(fmu, {"limit": 2.0}, list(inputs)) == expected
        said = fmu.log[-1].replace("percent", "%")  # a printf format cannot hold the sign
    assert 'the table turns "too fast" (100 % of \\ its limit): choose a lower speed' in said


def test_input_derivatives_are_what_the_model_evaluates() -> None:
    """Native: fmi2SetRealInputDerivatives; Python: the states that take them, set by hand."""
    model = read(TABLE_MODEL)
    instance = model.model_class()
    instance.initialize()
    with opened(built(TABLE_MODEL), model) as fmu:
        fmu.initialize()
        references = [fmu.by_name["speed_command"].reference] * 2 + [fmu.by_name["other_command"].reference]
        for number, (value, rate, bend, other) in enumerate([(1.0, 2.0, -3.0, 0.5), (2.0, 0.1, 0.0, 0.25)]):
            instance.speed_command, instance.command_rate, instance.command_bend = value, rate, bend
            instance.other_rate = other
            assert instance.step(number * 0.01, 0.01) == 0
            fmu.put("speed_command", value)
            fmu.slave.setRealInputDerivatives(references, [1, 2, 1], [rate, bend, other])
            fmu.step(number)
            assert [fmu.get("angle"), fmu.get("speed"), fmu.get("travel")] == [
                instance.angle, instance.speed, instance.travel]
            (slope,) = fmu.slave.getRealOutputDerivatives([fmu.by_name["angle"].reference], [1])
            assert slope == instance.speed


def test_the_clock_ticks_with_a_turn_and_event_mode_changes_nothing() -> None:
    model = read(TABLE_MODEL)
    inputs = [{"speed_command": 60.0}] * 60
    expected = run_python(model, model.model_class(), {}, list(inputs))
    ticks = []
    with opened3(built(TABLE_MODEL, 3), model, events=True) as fmu:
        clock = fmu.reference["turn_clock"]
        fmu.initialize()
        fmu.slave.updateDiscreteStates()
        fmu.slave.enterStepMode()
        for number, values in enumerate(inputs):
            fmu.put_all(values)
            event, *_ = fmu.slave.doStep(number * 0.01, 0.01)
            if event:
                fmu.slave.enterEventMode()
                ticks += [number] if _clock(fmu, clock) else []
                fmu.slave.updateDiscreteStates()
                fmu.slave.enterStepMode()
            assert fmu.everything() == expected[number + 1]
    turned = [number for number in range(60) if int(expected[number + 1]["turns[2]"]) > 0]
    assert ticks == turned
    assert len(turned) >= 4


def _clock(fmu: Fmu3, reference: int) -> bool:
    return bool(fmu.slave.getClock([reference])[0])
