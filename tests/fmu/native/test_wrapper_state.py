"""FMU states: every bit comes back, also from bytes in another process, and what is not a state is refused."""

from __future__ import annotations

import ctypes
import math
import random
import subprocess
import sys
from typing import Any

import hypothesis.strategies as st
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings

from tests.fmu.native.wrapper import (
    ENABLED,
    ERROR,
    FORCE,
    HERE,
    INTEGERS,
    LOAD_1,
    MASS,
    OK,
    Slave2,
    needs_compiler,
    slave2,
    slave3,
)

pytestmark = needs_compiler

H = 0.01


def run(slave: Slave2, first: int, count: int) -> list[list[str]]:
    rows = []
    for number in range(first, first + count):
        slave.fmu.setReal([FORCE, LOAD_1 + 1], [math.sin(number), math.cos(3.0 * number)])
        slave.fmu.setBoolean([ENABLED], [number % 7 != 0])
        slave.derive([FORCE], [1], [math.cos(number)])
        slave.fmu.doStep(number * H, H)
        rows.append(slave.everything())
    return rows


def saved_bytes(slave: Slave2) -> bytes:
    state = slave.fmu.getFMUstate()
    found = slave.fmu.serializeFMUstate(state)
    slave.fmu.freeFMUstate(state)
    return bytes(found)


def set_bytes(slave: Slave2, data: bytes) -> None:
    state = slave.fmu.deSerializeFMUstate(data)
    slave.fmu.setFMUstate(state)
    slave.fmu.freeFMUstate(state)


def test_state_restores_every_bit() -> None:
    saved_at = random.Random(5).randrange(10, 40)
    with slave2() as slave, slave2() as other:
        slave.fmu.setReal([MASS], [1.75])
        slave.initialize()
        run(slave, 0, saved_at)
        state, data, before = slave.fmu.getFMUstate(), saved_bytes(slave), slave.everything()
        first = run(slave, saved_at, 30)
        slave.fmu.setFMUstate(state)
        assert slave.everything() == before
        assert run(slave, saved_at, 30) == first
        slave.fmu.setFMUstate(state)  # may be set as often as one likes
        assert run(slave, saved_at, 30) == first
        set_bytes(other, data)  # of another instance, in another state of its life
        assert other.everything() == before
        assert run(other, saved_at, 30) == first
        other.fmu.setFMUstate(state)
        assert run(other, saved_at, 30) == first
        slave.fmu.freeFMUstate(state)


def test_state_holds_the_place_in_life() -> None:
    with slave2() as slave:
        new = slave.fmu.getFMUstate()
        slave.fmu.setReal([MASS], [2.0])
        slave.fmu.enterInitializationMode()
        initializing = slave.fmu.getFMUstate()
        slave.fmu.exitInitializationMode()
        slave.fmu.doStep(0.0, H)
        slave.fmu.setFMUstate(initializing)
        slave.fmu.setReal([FORCE, MASS], [4.0, 1.5])
        assert slave.fmu.getReal([5]) == [2.0]  # `initialize` is evaluated again
        slave.fmu.setFMUstate(new)
        slave.fmu.setupExperiment(startTime=3.0)
        slave.initialize()
        assert slave.fmu.getReal([MASS]) == [1.0]
        slave.fmu.doStep(0.0, H)
        for state in (new, initializing):
            slave.fmu.freeFMUstate(state)


def test_state_after_an_error_can_be_left() -> None:
    with slave2() as slave:
        slave.initialize()
        good = slave.fmu.getFMUstate()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.doStep(-1.0, H)
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.doStep(0.0, H)
        slave.fmu.setFMUstate(good)
        slave.fmu.doStep(0.0, H)
        slave.fmu.freeFMUstate(good)


PROGRAM = """
import sys
from tests.fmu.native.test_wrapper_state import *
with slave2() as slave:
    set_bytes(slave, sys.stdin.buffer.read())
    print(run(slave, 20, 20))
"""


def test_bytes_go_on_in_a_new_process() -> None:
    with slave2() as slave:
        slave.initialize()
        run(slave, 0, 20)
        data = saved_bytes(slave)
        expected = run(slave, 20, 20)
    done = subprocess.run([sys.executable, "-c", PROGRAM], input=data, capture_output=True, check=True,
                          cwd=HERE.parents[2])
    assert done.stdout.decode().strip() == str(expected)


real = st.floats(allow_nan=True, allow_infinity=True)


@given(st.lists(real, min_size=3, max_size=3), st.integers(-2**31, 2**31 - 1), st.booleans())
@settings(deadline=None, max_examples=200)
def test_serialized_values_are_exact(reals: list[float], whole: int, truth: bool) -> None:
    with slave2() as slave, slave2() as other:
        slave.fmu.setReal([FORCE, LOAD_1, MASS], reals)
        slave.fmu.setInteger([INTEGERS[0]], [whole])
        slave.fmu.setBoolean([ENABLED], [truth])
        data = saved_bytes(slave)
        set_bytes(other, data)
        assert saved_bytes(other) == data
        other.fmu.enterInitializationMode()
        assert list(map(repr, other.fmu.getReal([FORCE, LOAD_1, MASS]))) == list(map(repr, reals))
        assert (other.fmu.getInteger([INTEGERS[0]]), other.fmu.getBoolean([ENABLED])) == ([whole], [truth])


def test_layout_of_the_bytes_does_not_depend_on_the_machine() -> None:
    with slave2() as slave:
        slave.fmu.setReal([FORCE, LOAD_1], [1.0, -0.0])
        slave.fmu.setBoolean([ENABLED], [True])
        data = saved_bytes(slave)
    assert data[:8] == b"tpstate1"
    life = data[24:51]
    assert life == b"\x01\x01\x00" + bytes(16) + bytes.fromhex("000000000000f07f")
    assert data[51:76] == bytes.fromhex("000000000000f03f" "0000000000000080" "0000000000000000" "01")


# Refusals -----------------------------------------------------------------------------------------------------------


def deserialize(slave: Slave2, data: bytes) -> int:
    state = ctypes.c_void_p()
    result = int(slave.fmu.dll.fmi2DeSerializeFMUstate(slave.fmu.component, data, len(data), ctypes.byref(state)))
    assert (result == ERROR) == (state.value is None)
    return result


@given(st.data())
@settings(deadline=None, max_examples=100)
def test_damaged_bytes_are_refused(data: st.DataObject) -> None:
    with slave2() as slave:
        good = saved_bytes(slave)
        place = data.draw(st.integers(0, len(good) - 1))
        wrong = good[:place] + bytes([data.draw(st.integers(0, 255).filter(lambda byte: byte != good[place]))]) \
            + good[place + 1:]
        assert deserialize(slave, wrong) == ERROR
        assert deserialize(slave, good[:place]) == ERROR


@pytest.mark.parametrize(("wrong", "message"), [
    (b"", "not an FMU state"),
    (b"{}" * 200, "not an FMU state"),
    (b"tpstate1" + bytes(400), "belongs to another model, or to another build"),
])
def test_other_bytes_are_refused_with_the_reason(wrong: bytes, message: str) -> None:
    with slave2() as slave:
        assert deserialize(slave, wrong) == ERROR
        assert message in slave.log[-1][2]


def test_states_of_another_fmu_are_refused() -> None:
    with slave2() as older, slave3() as newer:
        state = newer.fmu.getFMUState()
        assert older.fmu.dll.fmi2SetFMUstate(older.fmu.component, state) == ERROR
        assert "belongs to another model" in older.log[-1][2]
        assert older.fmu.dll.fmi2FreeFMUstate(older.fmu.component, ctypes.byref(state)) == ERROR
        older.fmu.reset()
        assert deserialize(older, newer.fmu.serializeFMUState(state)) == ERROR
        assert "belongs to another model" in older.log[-1][2]
        newer.fmu.freeFMUState(state)


def test_null_states() -> None:
    def call(function: str, *arguments: Any) -> int:
        return int(getattr(slave.fmu.dll, function)(slave.fmu.component, *arguments))

    with slave2() as slave:
        nothing = ctypes.c_void_p()
        assert call("fmi2FreeFMUstate", ctypes.byref(nothing)) == OK
        assert call("fmi2FreeFMUstate", None) == OK
        assert slave.log == []
        assert call("fmi2SetFMUstate", None) == ERROR
        assert call("fmi2GetFMUstate", None) == ERROR
        assert call("fmi2SerializedFMUstateSize", None, None) == ERROR
        assert call("fmi2SerializeFMUstate", None, None, 0) == ERROR
        assert call("fmi2DeSerializeFMUstate", None, 0, ctypes.byref(nothing)) == ERROR


def test_too_small_a_buffer_is_refused_and_not_written() -> None:
    with slave2() as slave:
        state = slave.fmu.getFMUstate()
        buffer = ctypes.create_string_buffer(b"untouched", 16)
        assert slave.fmu.dll.fmi2SerializeFMUstate(slave.fmu.component, state, buffer, 16) == ERROR
        assert buffer.value == b"untouched"
        assert "ask for its size first" in slave.log[-1][2]
        slave.fmu.freeFMUstate(state)


def test_state_is_overwritten_in_place() -> None:
    with slave2() as slave:
        slave.initialize()
        state = ctypes.c_void_p()
        get = slave.fmu.dll.fmi2GetFMUstate
        assert get(slave.fmu.component, ctypes.byref(state)) == OK
        address = state.value
        slave.fmu.doStep(0.0, H)
        later = slave.everything()
        assert get(slave.fmu.component, ctypes.byref(state)) == OK
        assert state.value == address
        slave.fmu.reset()
        slave.fmu.setFMUstate(state)
        assert slave.everything() == later
        slave.fmu.freeFMUstate(state)


def test_fmi_3_states() -> None:
    with slave3(event_mode=True) as slave, slave3(event_mode=True) as other:
        slave.initialize()
        slave.fmu.enterStepMode()
        for number in range(3):
            slave.fmu.doStep(number * H, H)
        slave.fmu.enterEventMode()
        state = slave.fmu.getFMUState()
        data = slave.fmu.serializeFMUState(state)
        slave.fmu.enterStepMode()
        slave.fmu.doStep(3 * H, H)
        read = other.fmu.deserializeFMUState(data)
        other.fmu.setFMUState(read)
        slave.fmu.setFMUState(state)
        ticks = (ctypes.c_bool * 1)()
        for one in (slave, other):  # in the middle of an event, the clock still ticking
            assert one.fmu.dll.fmi3GetClock(one.fmu.component, (ctypes.c_uint * 1)(18), 1, ticks) == OK
            assert ticks[0]
            one.fmu.enterStepMode()
            one.fmu.doStep(3 * H, H)
        assert slave.fmu.getFloat64([4, 5], 5) == other.fmu.getFloat64([4, 5], 5)
        slave.fmu.freeFMUState(state)
        other.fmu.freeFMUState(read)
