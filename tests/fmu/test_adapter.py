"""The adapter without an FMU around it: serialised states are exact, and no order of calls breaks a slave."""

from __future__ import annotations

import math
import sys
import types
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from tests.fmu.driving import TEST_MODEL, read
from threadpitch.fmu import plain_module, scalars
from threadpitch.fmu.script import adapter_script

MODEL = read(TEST_MODEL)
REFERENCES = {scalar.name: scalar.reference for scalar in scalars(MODEL)}
INPUTS = [scalar.reference for scalar in scalars(MODEL)
          if scalar.variable.causality == "input" and scalar.variable.kind == "float"]
PARAMETERS = [REFERENCES[name] for name in ("mass", "stiffness", "damping", "weights[1]")]
any_float = st.floats(allow_nan=True, allow_infinity=True)


def _loaded(name: str, text: str) -> types.ModuleType:
    module = types.ModuleType(name)
    sys.modules[name] = module
    exec(compile(text, name, "exec"), module.__dict__)
    return module


@pytest.fixture(scope="module")
def slave_module() -> types.ModuleType:
    plain = plain_module(MODEL)
    _loaded(plain.name, plain.text)
    script = adapter_script(MODEL, plain)
    return _loaded(script.name, script.text)


def _slave(module: types.ModuleType) -> Any:
    return module.DampedMassSlave(instance_name="under_test", resources="")


@given(st.dictionaries(st.text(), any_float | st.integers() | st.booleans() | st.lists(any_float)))
@settings(deadline=None)
def test_serialised_states_are_exact(slave_module: types.ModuleType, fields: dict[str, Any]) -> None:
    slave_class = slave_module.DampedMassSlave
    state = {"content": "c", "mode": "step mode", "stale": True, "fields": fields}
    back = slave_class._fmu_state_from_bytes(slave_class._fmu_state_to_bytes(state))
    assert repr(back) == repr(state)  # repr tells 0.0 from -0.0, 1 from True, and NaN is equal to NaN


call = st.one_of(
    st.tuples(st.just("input"), st.sampled_from(INPUTS), any_float),
    st.tuples(st.just("parameter"), st.sampled_from(PARAMETERS), any_float),
    st.tuples(st.just("step"), st.just(0), st.floats(-1e-3, 0.1) | any_float),
    st.tuples(st.just("get"), st.sampled_from(INPUTS + PARAMETERS), st.just(0.0)),
    st.tuples(st.sampled_from(["enter", "exit", "save", "restore"]), st.just(0), st.just(0.0)),
)


@given(st.lists(call, max_size=30))
@settings(deadline=None)
def test_no_order_of_calls_breaks_a_slave(slave_module: types.ModuleType, calls: list[tuple[str, int, float]]) -> None:
    slave, saved, time, refused = _slave(slave_module), None, 0.0, ""
    for name, reference, value in calls:
        before = repr(slave._get_fmu_state())
        try:
            if name in ("input", "parameter"):
                slave.set_real([reference], [value])
            elif name == "step":
                if slave.do_step(time, value):
                    time += value
                else:
                    assert repr(slave._get_fmu_state()) == before
            elif name == "get":
                assert len(slave.get_real([reference])) == 1
            elif name == "enter" and slave.mode == "instantiated":
                slave.enter_initialization_mode()
            elif name == "exit" and slave.mode == "initialization mode":
                slave.exit_initialization_mode()
            elif name == "save":
                saved = slave._get_fmu_state()
            elif name == "restore" and saved is not None:
                slave._set_fmu_state(saved)
                assert repr(slave._get_fmu_state()) == repr(saved)
        except slave_module.RefusalError as error:
            refused = str(error)
            break  # after fmi2Fatal nothing may be called
        if slave.mode == "step mode":
            assert all(math.isfinite(value) for value in slave.get_real(PARAMETERS))
    assert "\n" not in refused


def test_wrong_type_is_refused(slave_module: types.ModuleType) -> None:
    slave = _slave(slave_module)
    with pytest.raises(slave_module.RefusalError, match="value reference 4 is not of type float"):
        slave.get_real([REFERENCES["locked"]])
    with pytest.raises(slave_module.RefusalError, match="value reference 0 is not of type int"):
        slave.set_integer([REFERENCES["base"]], [1])


def test_fault_in_the_model_fails_the_step_and_restores(slave_module: types.ModuleType) -> None:
    slave = _slave(slave_module)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    slave.model.mass = 0.0  # what the range keeps out: a division by zero in the middle of a step
    before = repr(slave._get_fmu_state())
    assert slave.do_step(0.0, 0.01) is False
    assert repr(slave._get_fmu_state()) == before
    assert "ZeroDivisionError in the model" in slave.log_queue[-1].msg
