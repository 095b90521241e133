"""The FMI 3.0 functions of the wrapper: arrays, types, modes, clocks, and the same trajectory as FMI 2.0."""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from tests.fmu.native.wrapper import (
    DISCARD,
    ERROR,
    HEADERS,
    OK,
    TOKEN,
    Slave3,
    library,
    needs_compiler,
    reals,
    references,
    slave2,
    slave3,
    status,
)

pytestmark = needs_compiler

FORCE, LOADS, ENABLED, COMMAND, POSITION, HISTORY, STEPS, COMPLETED, SEEN, VELOCITY, MASS, KIND, WEIGHTS = range(13)
GUIDED, LIMIT, TIME, CLOCK = 13, 14, 17, 18
FLOATS = (FORCE, LOADS, POSITION, HISTORY, VELOCITY, MASS, WEIGHTS, 15, 16)
FLOAT_COUNT = 1 + 2 + 1 + 4 + 1 + 1 + 2 + 1 + 1


def everything(slave: Slave3) -> list[str]:
    values = slave.fmu.getFloat64(FLOATS, FLOAT_COUNT)
    whole = slave.fmu.getInt32((COMMAND, STEPS, COMPLETED, KIND, LIMIT), 6)
    return [value.hex() for value in values] + [str(value) for value in
                                                (*whole, *slave.fmu.getBoolean((ENABLED, SEEN, GUIDED), 4))]


def step(slave: Slave3, time: float, step_size: float) -> tuple[int, bool, float]:
    """Status, eventHandlingNeeded and lastSuccessfulTime."""
    event, end, early = (ctypes.c_bool(True) for _ in range(3))
    reached = ctypes.c_double(math.nan)
    result = status(slave, "fmi3DoStep", time, step_size, True, ctypes.byref(event), ctypes.byref(end),
                    ctypes.byref(early), ctypes.byref(reached))
    if result != ERROR:
        assert (end.value, early.value) == (False, False)
    return result, event.value, reached.value


# Creation -----------------------------------------------------------------------------------------------------------


def test_wrong_token_is_refused_with_a_message() -> None:
    with slave3(logging=False) as slave:
        made = slave.fmu.dll.fmi3InstantiateCoSimulation(b"x", b"{other}", None, False, False, False, False, None, 0,
                                                         None, slave.fmu.logMessage, slave.fmu.intermediateUpdate)
        assert made is None
        assert slave.log == [(ERROR, "logStatusError", "the instantiation token is {other}, this library's is "
                                                       "{token-3}; use the modelDescription.xml that came with it")]


@pytest.mark.parametrize("name", [b"", b"  ", None])
def test_blank_name_is_refused(name: bytes | None) -> None:
    with slave3() as slave:
        made = slave.fmu.dll.fmi3InstantiateCoSimulation(name, TOKEN.encode(), None, False, False, False, False, None,
                                                         0, None, slave.fmu.logMessage, slave.fmu.intermediateUpdate)
        assert made is None
        assert "the instance has no name" in slave.log[-1][2]


def test_other_interface_types_are_refused() -> None:
    with slave3() as slave:
        assert slave.fmu.dll.fmi3InstantiateModelExchange(b"x", TOKEN.encode(), None, False, True, None,
                                                          slave.fmu.logMessage) is None
        assert "for co-simulation only" in slave.log[-1][2]


def test_event_mode_needs_a_clock() -> None:
    with slave3(clocks=False) as slave:
        slave.initialize()
        assert step(slave, 0.0, 0.1) == (OK, False, 0.1)
    with pytest.raises(Exception, match="instantiate"), slave3(clocks=False, event_mode=True):
        pass


def test_every_function_of_the_header_is_there() -> None:
    header = (HEADERS / "fmi3Functions.h").read_text()
    functions = re.findall(r"^FMI3_Export \w+\s+(fmi3\w+);", header, re.MULTILINE)
    assert len(functions) == 75
    loaded = ctypes.CDLL(str(library(3)))
    assert [name for name in functions if not hasattr(loaded, name)] == []


# Modes --------------------------------------------------------------------------------------------------------------

PHASES = ("instantiated", "initialization", "event", "step", "terminated", "error")


def bring(slave: Slave3, phase: str) -> None:
    """Bring a new instance into a state."""
    if phase == "initialization":
        slave.fmu.enterInitializationMode()
    elif phase != "instantiated":
        slave.initialize()
    if phase == "step":
        slave.fmu.enterStepMode()
    elif phase == "terminated":
        slave.fmu.terminate()
    elif phase == "error":
        assert status(slave, "fmi3EnterConfigurationMode") == ERROR


ANYWHERE = set(PHASES)
SETTABLE = {"instantiated", "initialization", "event", "step"}
FALSE = ctypes.c_bool(False)
CALLS: dict[str, tuple[set[str], Callable[[Slave3], int]]] = {
    "fmi3SetDebugLogging": (ANYWHERE, lambda s: status(s, "fmi3SetDebugLogging", True, 0, None)),
    "fmi3EnterInitializationMode": ({"instantiated"}, lambda s: status(s, "fmi3EnterInitializationMode", False, 0.0,
                                                                       0.0, False, 0.0)),
    "fmi3ExitInitializationMode": ({"initialization"}, lambda s: status(s, "fmi3ExitInitializationMode")),
    "fmi3EnterEventMode": ({"step"}, lambda s: status(s, "fmi3EnterEventMode")),
    "fmi3EnterStepMode": ({"event"}, lambda s: status(s, "fmi3EnterStepMode")),
    "fmi3EvaluateDiscreteStates": ({"event"}, lambda s: status(s, "fmi3EvaluateDiscreteStates")),
    "fmi3UpdateDiscreteStates": ({"event"}, lambda s: status(
        s, "fmi3UpdateDiscreteStates", *[ctypes.byref(ctypes.c_bool()) for _ in range(5)],
        ctypes.byref(ctypes.c_double()))),
    "fmi3GetClock": ({"event"}, lambda s: status(s, "fmi3GetClock", references(CLOCK), 1, (ctypes.c_bool * 1)())),
    "fmi3Terminate": ({"event", "step"}, lambda s: status(s, "fmi3Terminate")),
    "fmi3Reset": (ANYWHERE, lambda s: status(s, "fmi3Reset")),
    "fmi3GetFloat64": (ANYWHERE, lambda s: status(s, "fmi3GetFloat64", references(MASS), 1, reals(0.0), 1)),
    "fmi3SetFloat64": (SETTABLE, lambda s: status(s, "fmi3SetFloat64", references(FORCE), 1, reals(1.0), 1)),
    "fmi3GetOutputDerivatives": ({"step", "terminated", "error"}, lambda s: status(
        s, "fmi3GetOutputDerivatives", references(POSITION), 1, (ctypes.c_int * 1)(1), reals(0.0), 1)),
    "fmi3DoStep": ({"step"}, lambda s: step(s, 0.0, 0.01)[0]),
}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("function", CALLS)
def test_state_machine_of_the_standard(function: str, phase: str) -> None:
    allowed, call = CALLS[function]
    with slave3(event_mode=True) as slave:
        bring(slave, phase)
        slave.log.clear()
        if phase in allowed:
            assert call(slave) == OK
            assert slave.log == []
        else:
            assert call(slave) == ERROR
            assert slave.log[-1][2].startswith(f"{function} is not allowed: the FMU is in ")
            assert step(slave, 0.0, 0.1)[0] == ERROR
            assert status(slave, "fmi3Reset") == OK
            slave.initialize()


def test_event_mode_must_be_asked_for() -> None:
    with slave3() as slave:
        slave.initialize()
        assert step(slave, 0.0, 0.1)[0] == OK
        assert status(slave, "fmi3EnterEventMode") == ERROR
        assert "set eventModeUsed" in slave.log[-1][2]


# Values -------------------------------------------------------------------------------------------------------------


def test_start_values_arrays_and_time() -> None:
    with slave3() as slave:
        assert slave.fmu.getFloat64([MASS, WEIGHTS, TIME], 4) == [1.0, 1.0, 1.0, 0.0]
        slave.fmu.setFloat64([WEIGHTS, FORCE, LOADS], [0.5, 0.25, 4.0, 2.0, 3.0])
        slave.fmu.setInt32([KIND], [2])
        slave.fmu.setBoolean([ENABLED], [False])
        slave.fmu.enterInitializationMode(startTime=2.5)
        assert slave.fmu.getFloat64([POSITION, HISTORY, TIME], 6) == [2.0] * 5 + [2.5]
        slave.fmu.exitInitializationMode()
        assert slave.fmu.getFloat64([LOADS, WEIGHTS], 4) == [2.0, 3.0, 0.5, 0.25]
        assert step(slave, 2.5, 0.5) == (OK, False, 3.0)
        assert slave.fmu.getFloat64([TIME, HISTORY], 5) == [3.0, 3.0, 2.0, 2.0, 2.0]
        assert slave.fmu.getInt32([COMPLETED, KIND], 3) == [1, 0, 2]
        assert slave.fmu.getBoolean([SEEN, ENABLED], 3) == [True, False, False]


@pytest.mark.parametrize(("used", "room", "message"), [
    ((WEIGHTS,), 1, "1 values are not enough for weights"),
    ((WEIGHTS,), 3, "fmi3GetFloat64 has variables of 2 values and room for 3; make them equal"),
    ((TIME, WEIGHTS), 2, "2 values are not enough for weights"),
    ((WEIGHTS, TIME, TIME), 3, "value reference 17 is not of type float"),
    ((CLOCK,), 1, "value reference 18 is not of type float"),
    ((STEPS,), 1, "value reference 6 is not of type float"),
])
def test_number_of_values_must_be_right(used: tuple[int, ...], room: int, message: str) -> None:
    with slave3() as slave:
        slave.initialize()
        assert status(slave, "fmi3GetFloat64", references(*used), len(used), reals(*[0.0] * 8), room) == ERROR
        assert message in slave.log[-1][2]


@pytest.mark.parametrize(("put", "message"), [
    (lambda fmu: fmu.setFloat64([MASS], [1.5]), "parameter mass is fixed in step mode"),
    (lambda fmu: fmu.setFloat64([WEIGHTS], [1.0, 1.0]), "parameter weights[1] is fixed in step mode"),
    (lambda fmu: fmu.setFloat64([HISTORY], [1.0] * 4), "history[1] is calculated by the model"),
    (lambda fmu: fmu.setFloat64([TIME], [1.0]), "value reference 17 is not of type float"),
    (lambda fmu: fmu.setInt64([COMMAND], [1]), "fmi3SetInt64 is not for this FMU: its variables are Float64, Int32"),
    (lambda fmu: fmu.setString([COMMAND], ["1"]), "fmi3SetString is not for this FMU"),
    (lambda fmu: fmu.getUInt8([COMMAND]), "fmi3GetUInt8 is not for this FMU"),
    (lambda fmu: fmu.getFloat32([FORCE]), "fmi3GetFloat32 is not for this FMU"),
    (lambda fmu: fmu.setInt32([STEPS], [1]), "steps is calculated by the model"),
    (lambda fmu: fmu.setBoolean([FORCE], [True]), "value reference 0 is not of type bool"),
    (lambda fmu: fmu.enterConfigurationMode(), "fmi3EnterConfigurationMode is not provided"),
    (lambda fmu: fmu.getDirectionalDerivative([POSITION], [FORCE], [1.0]), "fmi3GetDirectionalDerivative is not"),
])
def test_what_is_not_possible_is_refused(put: Callable[[Any], None], message: str) -> None:
    with slave3() as slave:
        slave.initialize()
        with pytest.raises(FMICallException, match="error"):
            put(slave.fmu)
        assert message in slave.log[-1][2]


def test_refused_parameters_are_named() -> None:
    with slave3() as slave:
        slave.fmu.setFloat64([WEIGHTS], [1.0, -1.0])
        slave.fmu.enterInitializationMode()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.exitInitializationMode()
        assert slave.log[-1][2] == "parameter weights[2] is -1.0; set a value from 0.0 to infinity"


def test_discarded_step_leaves_the_fmu_as_it_was() -> None:
    with slave3() as slave:
        slave.initialize()
        assert step(slave, 0.0, 0.25) == (OK, False, 0.25)
        slave.fmu.setFloat64([LOADS], [0.0, math.nan])
        before = everything(slave)
        assert step(slave, 0.25, 0.25) == (DISCARD, False, 0.25)
        assert slave.log[-1] == (DISCARD, "logStatusDiscard", "the step from 0.25 s of 0.25 s is refused: input "
                                                              "loads[2] is nan; connect a finite value")
        assert everything(slave) == before
        slave.fmu.setFloat64([LOADS, FORCE], [0.0, 0.0, 1e9])
        assert step(slave, 0.25, 0.25)[0] == DISCARD
        assert "100 % of its guide ##1" in slave.log[-1][2]
        slave.fmu.setFloat64([FORCE], [0.0])
        assert step(slave, 0.25, 0.25) == (OK, False, 0.5)


# Clocks -------------------------------------------------------------------------------------------------------------


def clock(slave: Slave3) -> bool:
    values = (ctypes.c_bool * 1)()
    assert status(slave, "fmi3GetClock", references(CLOCK), 1, values) == OK
    return bool(values[0])


def test_clock_ticks_at_the_end_of_the_step_that_counted() -> None:
    with slave3(event_mode=True) as slave:
        slave.initialize()
        assert clock(slave) is False
        assert slave.fmu.updateDiscreteStates() == (False, False, False, False, False, 0.0)
        slave.fmu.enterStepMode()
        for number in range(9):
            result, event, _ = step(slave, number * 0.1, 0.1)
            assert (result, event) == (OK, number % 3 == 2)
            if event or number == 4:
                slave.fmu.enterEventMode()
                assert clock(slave) is event
                slave.fmu.updateDiscreteStates()
                assert clock(slave) is False
                slave.fmu.enterStepMode()
                if event:  # an event of the importer's at the same time: the clock does not tick again
                    slave.fmu.enterEventMode()
                    assert clock(slave) is False
                    slave.fmu.enterStepMode()


def test_wrong_clock_is_refused() -> None:
    for reference in (FORCE, TIME, CLOCK + 1):
        with slave3(event_mode=True) as slave:
            slave.initialize()
            assert status(slave, "fmi3GetClock", references(reference), 1, (ctypes.c_bool * 1)()) == ERROR
            assert slave.log[-1][2] == f"value reference {reference} is not a clock of this FMU"
    with slave3(event_mode=True) as slave:
        slave.initialize()
        assert status(slave, "fmi3SetClock", references(CLOCK), 1, (ctypes.c_bool * 1)()) == ERROR


def test_trajectory_is_that_of_fmi_2_with_and_without_event_mode() -> None:
    rows = []
    for event_mode in (False, True):
        with slave3(event_mode=event_mode) as slave:
            slave.initialize()
            if event_mode:
                slave.fmu.enterStepMode()
            row = [everything(slave)]
            for number in range(20):
                slave.fmu.setFloat64([FORCE, LOADS], [math.sin(number), 0.1 * number, 0.0])
                if step(slave, 0.1 * number, 0.1)[1]:
                    slave.fmu.enterEventMode()
                    slave.fmu.updateDiscreteStates()
                    slave.fmu.enterStepMode()
                row.append(everything(slave))
            rows.append(row)
    with slave2() as older:
        older.initialize()
        row = [older.everything()]
        for number in range(20):
            older.fmu.setReal([0, 1], [math.sin(number), 0.1 * number])
            older.fmu.doStep(0.1 * number, 0.1)
            row.append(older.everything())
    assert rows[0] == rows[1]
    assert [values[:FLOAT_COUNT] for values in rows[0]] == [values[:FLOAT_COUNT] for values in row]


# Messages -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("logging", "switched", "expected"), [
    (True, [], {DISCARD, ERROR}),
    (False, [], set()),  # FMI 3.0.2, section 2.3.1: any logging is disabled
    (False, [(True, "logStatusError")], {ERROR}),
    (True, [(False,), (True, "logStatusDiscard")], {DISCARD}),
    (True, [(False, "logStatusDiscard", "logStatusFatal")], {ERROR}),
    (True, [(True, "logStatusDiscard")], {DISCARD, ERROR}),
    (False, [(True, "logAll")], {DISCARD, ERROR}),
])
def test_log_categories(logging: bool, switched: list[tuple[Any, ...]], expected: set[int]) -> None:
    with slave3(logging=logging) as slave:
        for on, *names in switched:
            listed = (ctypes.c_char_p * len(names))(*[name.encode() for name in names])
            assert status(slave, "fmi3SetDebugLogging", on, len(names), listed) == OK
        slave.initialize()
        slave.fmu.setFloat64([FORCE], [math.nan])
        assert step(slave, 0.0, 0.1)[0] == DISCARD
        assert step(slave, 5.0, 0.1)[0] == ERROR
        assert {message[0] for message in slave.log} == expected
