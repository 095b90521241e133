"""FMI 2.0 in the wrapper: checks of values, steps, several lives and instances, messages."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from tests.fmu.native.wrapper import (
    COMMAND,
    DISCARD,
    ERROR,
    FORCE,
    HISTORY_1,
    KIND,
    LIMIT,
    LOAD_1,
    MASS,
    OK,
    STEPS,
    WEIGHT_1,
    WEIGHT_2,
    Slave2,
    needs_compiler,
    references,
    slave2,
    status,
)

pytestmark = needs_compiler

# Checks -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("function", "reference", "value", "message"), [
    ("setReal", MASS, math.nextafter(2.0, 3.0),
     "parameter mass is 2.0000000000000004; set a value from 0.1 to 2.0 kg"),
    ("setReal", MASS, math.nan, "parameter mass is nan; set a finite value"),
    ("setReal", MASS, 1e-17, "parameter mass is 1e-17; set a value from 0.1 to 2.0 kg"),
    ("setReal", WEIGHT_2, -math.inf, "parameter weights[2] is -inf; set a finite value"),
    ("setReal", WEIGHT_2, -0.5, "parameter weights[2] is -0.5; set a value from 0.0 to infinity"),
    ("setReal", FORCE, math.inf, "input force is inf; set a finite value"),
    ("setReal", LOAD_1 + 1, math.nan, "input loads[2] is nan; set a finite value"),
    ("setInteger", KIND, 3, "parameter kind is 3; set one of spring = 1, rubber = 2"),
    ("setInteger", LIMIT, -7, "parameter limit is -7; set a value from 1 to 1000"),
    ("setInteger", COMMAND, 6, "steps is 4294967296, beyond the 32 bits of an FMI integer"),
])
def test_initialization_refuses_by_name(function: str, reference: int, value: float, message: str) -> None:
    with slave2() as slave:
        getattr(slave.fmu, function)([reference], [value])
        slave.fmu.enterInitializationMode()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.exitInitializationMode()
        assert slave.log == [(ERROR, "logStatusError", message)]
        slave.fmu.reset()
        slave.initialize()


@pytest.mark.parametrize(("reference", "value"), [(MASS, 0.1), (MASS, 2.0), (WEIGHT_1, 0.0), (WEIGHT_1, 1e300)])
def test_limits_themselves_are_accepted(reference: int, value: float) -> None:
    with slave2() as slave:
        slave.fmu.setReal([reference], [value])
        slave.initialize()


def test_declared_error_of_the_parameters() -> None:
    with slave2() as slave:
        slave.fmu.setReal([WEIGHT_1, WEIGHT_2], [0.0, 0.0])
        slave.fmu.enterInitializationMode()
        with pytest.raises(FMICallException, match="error"):
            slave.fmu.exitInitializationMode()
        assert slave.log[-1][2] == "weights must not all be zero: set one of them"


def test_integer_that_does_not_fit_is_not_got_wrongly() -> None:
    with slave2() as slave:
        slave.fmu.enterInitializationMode()
        slave.fmu.setInteger([COMMAND], [6])
        assert status(slave, "fmi2GetInteger", references(STEPS), 1, (ctypes.c_int * 1)()) == ERROR
        assert slave.log[-1][2] == "steps is 4294967296, beyond the 32 bits of an FMI integer"


# Steps --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("reference", "name"), [(FORCE, "force"), (LOAD_1, "loads[1]"), (LOAD_1 + 1, "loads[2]")])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_inputs_that_are_not_finite_discard_the_step(reference: int, name: str, value: float) -> None:
    with slave2() as slave:
        slave.initialize()
        slave.fmu.doStep(0.0, 0.25)
        slave.fmu.setReal([reference], [value])
        before = slave.everything()
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(0.25, 0.5)
        assert slave.everything() == before
        assert slave.log == [(DISCARD, "logStatusDiscard", f"the step from 0.25 s of 0.5 s is refused: input {name} is "
                                                           f"{value!r}; connect a finite value")]
        assert slave.fmu.getRealStatus(2) == 0.25
        slave.fmu.setReal([reference], [1.0])
        slave.fmu.doStep(0.25, 0.5)
        assert slave.fmu.getRealStatus(2) == 0.75


@pytest.mark.parametrize(("put", "message"), [
    (lambda fmu: fmu.setReal([FORCE], [1e9]), "the mass left 100 percent of its guide ##1: choose a smaller force"),
    (lambda fmu: fmu.setInteger([COMMAND], [7]), "the model reports the undeclared error 7"),
    (lambda fmu: fmu.setInteger([COMMAND], [8]), "steps is 2147483649, beyond the 32 bits of an FMI integer"),
])
def test_step_that_fails_changes_nothing(put: Callable[[Any], None], message: str) -> None:
    with slave2() as slave:
        slave.initialize()
        slave.fmu.doStep(0.0, 0.1)
        put(slave.fmu)
        before = slave.everything()
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(0.1, 0.1)
        assert slave.everything() == before
        assert slave.log[-1][2] == f"the step from 0.1 s of 0.1 s is refused: {message}"
        slave.fmu.setReal([FORCE], [0.0])
        slave.fmu.setInteger([COMMAND], [0])
        slave.fmu.doStep(0.1, 0.1)


def test_after_a_refused_step_the_fmu_wants_to_end_until_something_else_is_done() -> None:
    def refused(time: float) -> bool:
        slave.fmu.setReal([FORCE], [1e9])
        with pytest.raises(FMICallException, match="discard"):
            slave.fmu.doStep(time, 0.1)
        assert slave.fmu.getRealStatus(2) == time
        return bool(slave.fmu.getBooleanStatus(3))

    with slave2() as slave:
        slave.initialize()
        assert slave.fmu.getBooleanStatus(3) is False
        assert refused(0.0)
        state = slave.fmu.getFMUState()
        slave.fmu.setReal([FORCE], [0.0])
        slave.fmu.doStep(0.0, 0.1)
        assert slave.fmu.getBooleanStatus(3) is False
        assert refused(0.1)
        slave.fmu.setFMUState(state)
        assert slave.fmu.getBooleanStatus(3) is False
        slave.fmu.freeFMUState(state)
        assert refused(0.0)
        slave.fmu.reset()
        slave.initialize()
        assert slave.fmu.getBooleanStatus(3) is False


@pytest.mark.parametrize(("time", "step_size", "message"), [
    (0.5, 0.0, "the step size must be positive and finite"),
    (0.5, -0.1, "the step size must be positive and finite"),
    (0.5, math.nan, "the step size must be positive and finite"),
    (0.5, math.inf, "the step size must be positive and finite"),
    (0.0, 0.1, "the FMU is at 0.5 s; step on from there"),
    (0.50001, 0.1, "the FMU is at 0.5 s; step on from there"),
    (math.nan, 0.1, "the FMU is at 0.5 s; step on from there"),
    (0.5, 0.6, "it passes the stop time 1.0 s"),
])
def test_wrong_times_are_errors(time: float, step_size: float, message: str) -> None:
    with slave2() as slave:
        slave.fmu.setupExperiment(startTime=0.0, stopTime=1.0)
        slave.fmu.enterInitializationMode()
        slave.fmu.exitInitializationMode()
        slave.fmu.doStep(0.0, 0.5)
        before = slave.everything()
        assert status(slave, "fmi2DoStep", time, step_size, 1) == ERROR
        assert slave.log[-1][2] == f"the step from {time!r} s of {step_size!r} s is refused: {message}"
        assert slave.everything() == before


def test_times_may_differ_by_how_importers_count() -> None:
    step_size, nanoseconds = 1.0 / 3000.0, round(1e9 / 3000.0)
    with slave2() as added, slave2() as whole:
        for slave in (added, whole):
            slave.fmu.setupExperiment(startTime=0.0, stopTime=1.0)
            slave.fmu.enterInitializationMode()
            slave.fmu.exitInitializationMode()
        time = 0.0
        for number in range(3000):
            added.fmu.doStep(time, step_size)
            whole.fmu.doStep(number * nanoseconds * 1e-9, nanoseconds * 1e-9)
            time += step_size


@pytest.mark.parametrize(("start", "stop"), [(math.nan, 1.0), (math.inf, 1.0), (1.0, 0.5), (0.0, math.nan)])
def test_impossible_experiment_is_refused(start: float, stop: float) -> None:
    with slave2() as slave:
        assert status(slave, "fmi2SetupExperiment", 0, 0.0, start, 1, stop) == ERROR
        assert "a run from" in slave.log[-1][2]


def test_run_may_start_at_any_time() -> None:
    with slave2() as slave:
        slave.fmu.setupExperiment(startTime=-7.5)
        slave.fmu.enterInitializationMode()
        slave.fmu.exitInitializationMode()
        assert slave.fmu.getRealStatus(2) == -7.5
        slave.fmu.doStep(-7.5, 0.5)
        assert slave.fmu.getReal([HISTORY_1]) == [-7.0]


def test_status_of_steps_that_are_never_pending() -> None:
    with slave2() as slave:
        slave.initialize()
        assert slave.fmu.getBooleanStatus(3) is False
        for function, kind, place in (("fmi2GetStatus", 0, ctypes.c_int()), ("fmi2GetRealStatus", 0, ctypes.c_double()),
                                      ("fmi2GetIntegerStatus", 0, ctypes.c_int()),
                                      ("fmi2GetBooleanStatus", 1, ctypes.c_int()),
                                      ("fmi2GetStringStatus", 1, ctypes.c_char_p())):
            assert status(slave, function, kind, ctypes.byref(place)) == DISCARD
            assert slave.log[-1][0] == DISCARD
        slave.fmu.doStep(0.0, 0.1)


# Lives --------------------------------------------------------------------------------------------------------------


def run(slave: Slave2) -> list[list[str]]:
    slave.initialize()
    rows = [slave.everything()]
    for number in range(20):
        slave.fmu.setReal([FORCE, LOAD_1], [math.sin(number), 0.1 * number])
        slave.fmu.doStep(0.1 * number, 0.1)
        rows.append(slave.everything())
    return rows


def test_reset_is_as_new() -> None:
    with slave2() as used, slave2() as new:
        used.fmu.setReal([MASS, WEIGHT_1], [1.5, 3.0])
        used.fmu.setInteger([KIND], [2])
        assert run(used) != run(new)
        used.fmu.reset()
        used.fmu.reset()
        new.fmu.reset()
        assert run(used) == run(new)
        used.fmu.terminate()
        used.fmu.reset()
        used.initialize()


def test_instances_do_not_mix() -> None:
    with slave2("a") as a, slave2("b") as b:
        a.fmu.setReal([MASS], [2.0])
        alone = run(a)
        a.fmu.reset()
        a.fmu.setReal([MASS], [2.0])
        a.initialize()
        b.initialize()
        rows = [a.everything()]
        for number in range(20):
            for slave in (a, b):
                slave.fmu.setReal([FORCE, LOAD_1], [math.sin(number), 0.1 * number])
                slave.fmu.doStep(0.1 * number, 0.1)
            rows.append(a.everything())
        assert rows == alone
        assert rows[-1] != b.everything()


def test_instances_in_threads_do_not_mix() -> None:
    def alone(number: int) -> list[list[str]]:
        with slave2(f"thread {number}") as slave:
            slave.fmu.setReal([MASS], [1.0 + number / 8])
            return run(slave)

    expected = [alone(number) for number in range(8)]
    with ThreadPoolExecutor(max_workers=8) as pool:
        assert list(pool.map(alone, range(8))) == expected


# Messages -----------------------------------------------------------------------------------------------------------


def switch(slave: Slave2, on: bool, *names: str) -> int:
    return status(slave, "fmi2SetDebugLogging", int(on), len(names),
                  (ctypes.c_char_p * len(names))(*[name.encode() for name in names]))


def logged(slave: Slave2) -> set[int]:
    """The statuses of what is said about a discarded step and an error."""
    slave.initialize()
    slave.log.clear()
    slave.fmu.setReal([FORCE], [math.nan])
    assert status(slave, "fmi2DoStep", 0.0, 0.1, 1) == DISCARD
    assert status(slave, "fmi2CancelStep") == ERROR
    return {message[0] for message in slave.log}


@pytest.mark.parametrize(("logging", "switched", "expected"), [
    (True, [], {DISCARD, ERROR}),
    (False, [], {ERROR}),  # FMI 2.0.5, section 2.1.3: a Discard is said in debug mode only
    (False, [(True,)], {DISCARD, ERROR}),
    (True, [(False,)], set()),
    (True, [(True, "logStatusDiscard")], {DISCARD}),
    (True, [(True, "logStatusWarning", "logStatusError")], {ERROR}),
    (True, [(False, "logStatusDiscard")], {ERROR}),
    (False, [(True, "logAll")], {DISCARD, ERROR}),
    (True, [(False, "logAll")], set()),
])
def test_log_categories(logging: bool, switched: list[tuple[Any, ...]], expected: set[int]) -> None:
    with slave2(logging=logging) as slave:
        for on, *names in switched:
            assert switch(slave, on, *names) == OK
        assert logged(slave) == expected


def test_unknown_log_category_is_refused() -> None:
    with slave2() as slave:
        assert switch(slave, True, "logStatusError", "logNothing") == ERROR
        assert "log category logNothing is not known; choose logStatusWarning" in slave.log[-1][2]
