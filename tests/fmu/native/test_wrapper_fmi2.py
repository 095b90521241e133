"""The FMI 2.0 functions of the wrapper: creation, the state machine and values."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2CallbackFunctions

from tests.fmu.native.wrapper import (
    BOOLEANS,
    COMMAND,
    ENABLED,
    ERROR,
    FORCE,
    GUID,
    GUIDED,
    HISTORY_1,
    INTEGERS,
    KIND,
    LIMIT,
    LOAD_1,
    MASS,
    OK,
    POSITION,
    STEPS,
    VELOCITY,
    WEIGHT_1,
    WEIGHT_2,
    Slave2,
    compiled,
    library,
    needs_compiler,
    reals,
    references,
    slave2,
    sources,
    status,
)

pytestmark = needs_compiler

CO_SIMULATION = 1
PHASES = ("instantiated", "initialization", "step", "terminated", "error")


def bring(slave: Slave2, phase: str) -> None:
    """Bring a new instance into a state."""
    if phase == "initialization":
        slave.fmu.enterInitializationMode()
    elif phase != "instantiated":
        slave.initialize()
    if phase == "terminated":
        slave.fmu.terminate()
    elif phase == "error":
        assert status(slave, "fmi2CancelStep") == ERROR


# Creation -----------------------------------------------------------------------------------------------------------


def test_version_and_platform() -> None:
    with slave2() as slave:
        assert slave.fmu.fmi2GetVersion() == b"2.0"
        assert slave.fmu.fmi2GetTypesPlatform() == b"default"


def instantiate(slave: Slave2, name: bytes | None, kind: int, guid: bytes | None, callbacks: Any) -> int | None:
    pointer = ctypes.byref(callbacks) if callbacks is not None else None
    return slave.fmu.dll.fmi2Instantiate(name, kind, guid, None, pointer, 0, 1)  # type: ignore[no-any-return]


@pytest.mark.parametrize(("name", "kind", "guid", "message"), [
    (b"x", CO_SIMULATION, b"{other}", "the GUID is {other}, this library's is {guid-2}"),
    (b"x", CO_SIMULATION, None, "the GUID is NULL, this library's is {guid-2}"),
    (b"x", 0, GUID.encode(), "for co-simulation only"),
    (b" \t", CO_SIMULATION, GUID.encode(), "the instance has no name"),
    (None, CO_SIMULATION, GUID.encode(), "the instance has no name"),
])
def test_refused_instantiation_says_why(name: bytes | None, kind: int, guid: bytes | None, message: str) -> None:
    with slave2(logging=False) as slave:
        assert instantiate(slave, name, kind, guid, slave.fmu.callbacks) is None
        ((logged, category, text),) = slave.log
        assert (logged, category) == (ERROR, "logStatusError")
        assert message in text


def test_missing_callbacks_are_no_fault() -> None:
    with slave2() as slave:
        for callbacks in (None, fmi2CallbackFunctions()):
            instance = instantiate(slave, b"quiet", CO_SIMULATION, GUID.encode(), callbacks)
            assert instance is not None
            assert slave.fmu.dll.fmi2DoStep(instance, 0.0, 1.0, 1) == ERROR
            slave.fmu.dll.fmi2FreeInstance(instance)


def test_null_instance_is_an_error_not_a_crash() -> None:
    with slave2() as slave:
        dll, value = slave.fmu.dll, reals(0.0)
        assert dll.fmi2GetReal(None, references(POSITION), 1, value) == ERROR
        assert dll.fmi2SetReal(None, references(FORCE), 1, value) == ERROR
        assert dll.fmi2DoStep(None, 0.0, 1.0, 1) == ERROR
        for function in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset",
                         "fmi2CancelStep"):
            assert getattr(dll, function)(None) == ERROR
        dll.fmi2FreeInstance(None)


def test_only_fmi_functions_are_exported() -> None:
    for version in (2, 3):
        listed = subprocess.run(["nm", "-D", "--defined-only", str(library(version))], capture_output=True, text=True,
                                check=True).stdout
        exported = {line.split()[-1] for line in listed.splitlines()}
        assert all(name.startswith(f"fmi{version}") for name in exported)
        assert f"fmi{version}DoStep" in exported


@pytest.mark.parametrize("version", [2, 3])
def test_wrapper_has_no_variables_of_its_own(version: int) -> None:
    for path in sources(version):
        made = compiled(f"{version}-{path.stem}.o", (path,), ("-c", "-O2"))
        listed = subprocess.run(["nm", str(made)], capture_output=True, text=True, check=True).stdout
        kinds = {line.split()[-2] for line in listed.splitlines()}
        assert not kinds & set("BbDCcSsGg"), path.name  # variables that can be written, in any section


# The state machine --------------------------------------------------------------------------------------------------

ANYWHERE = set(PHASES)
READABLE = {"initialization", "step", "terminated", "error"}
STATUS = {"step", "terminated"}
CALLS: dict[str, tuple[set[str], Callable[[Slave2], int]]] = {  # FMI 2.0.5, section 4.2.4
    "fmi2SetDebugLogging": (ANYWHERE, lambda s: status(s, "fmi2SetDebugLogging", 1, 0, None)),
    "fmi2SetupExperiment": ({"instantiated"}, lambda s: status(s, "fmi2SetupExperiment", 0, 0.0, 0.0, 0, 0.0)),
    "fmi2EnterInitializationMode": ({"instantiated"}, lambda s: status(s, "fmi2EnterInitializationMode")),
    "fmi2ExitInitializationMode": ({"initialization"}, lambda s: status(s, "fmi2ExitInitializationMode")),
    "fmi2Terminate": ({"step"}, lambda s: status(s, "fmi2Terminate")),
    "fmi2Reset": (ANYWHERE, lambda s: status(s, "fmi2Reset")),
    "fmi2GetReal": (READABLE, lambda s: status(s, "fmi2GetReal", references(POSITION), 1, reals(0.0))),
    "fmi2GetInteger": (READABLE, lambda s: status(s, "fmi2GetInteger", references(STEPS), 1, (ctypes.c_int * 1)())),
    "fmi2GetBoolean": (READABLE, lambda s: status(s, "fmi2GetBoolean", references(ENABLED), 1, (ctypes.c_int * 1)())),
    "fmi2GetString": (READABLE, lambda s: status(s, "fmi2GetString", None, 0, None)),
    "fmi2SetReal": ({"instantiated", "initialization", "step"},
                    lambda s: status(s, "fmi2SetReal", references(FORCE), 1, reals(1.0))),
    "fmi2SetRealInputDerivatives": ({"instantiated", "initialization", "step"},
                                    lambda s: status(s, "fmi2SetRealInputDerivatives", references(FORCE), 1,
                                                     (ctypes.c_int * 1)(1), reals(1.0))),
    "fmi2GetRealOutputDerivatives": ({"step", "terminated", "error"},
                                     lambda s: status(s, "fmi2GetRealOutputDerivatives", references(POSITION), 1,
                                                      (ctypes.c_int * 1)(1), reals(0.0))),
    "fmi2DoStep": ({"step"}, lambda s: status(s, "fmi2DoStep", 0.0, 0.01, 1)),
    "fmi2GetRealStatus": (STATUS, lambda s: status(s, "fmi2GetRealStatus", 2, reals(0.0))),
    "fmi2GetBooleanStatus": (STATUS, lambda s: status(s, "fmi2GetBooleanStatus", 3, (ctypes.c_int * 1)())),
}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("function", CALLS)
def test_state_machine_of_the_standard(function: str, phase: str) -> None:
    allowed, call = CALLS[function]
    with slave2() as slave:
        bring(slave, phase)
        slave.log.clear()
        if phase in allowed:
            assert call(slave) == OK
            assert slave.log == []
        else:
            assert call(slave) == ERROR
            ((logged, _, text),) = slave.log
            assert logged == ERROR
            assert text.startswith(f"{function} is not allowed: the FMU is in ")
            assert CALLS["fmi2DoStep"][1](slave) == ERROR  # the state error
            assert status(slave, "fmi2Reset") == OK
            slave.initialize()


def test_state_machine_messages_name_the_mend() -> None:
    with slave2() as slave:
        assert status(slave, "fmi2DoStep", 0.0, 0.01, 1) == ERROR
        assert slave.log[-1][2] == ("fmi2DoStep is not allowed: the FMU is in the state instantiated; "
                                    "exit initialization mode first")
        assert status(slave, "fmi2DoStep", 0.0, 0.01, 1) == ERROR
        assert slave.log[-1][2].endswith("the FMU is in the state error; reset the FMU or free it")


def test_functions_of_capabilities_that_are_not_there() -> None:
    for function, arguments in {"fmi2CancelStep": (), "fmi2GetDirectionalDerivative": (None, 0, None, 0, None, None),
                                "fmi2GetString": (references(0), 1, (ctypes.c_char_p * 1)()),
                                "fmi2SetString": (references(0), 1, (ctypes.c_char_p * 1)())}.items():
        with slave2() as slave:
            slave.initialize()
            assert status(slave, function, *arguments) == ERROR
            assert slave.log[-1][0] == ERROR


# Values -------------------------------------------------------------------------------------------------------------


def test_start_values_and_every_kind() -> None:
    with slave2() as slave:
        slave.fmu.setReal([FORCE, LOAD_1, WEIGHT_2], [2.0, 3.0, 0.5])
        slave.fmu.setInteger([KIND, COMMAND], [2, 9])
        slave.fmu.setBoolean([GUIDED], [7])
        slave.initialize()
        assert slave.fmu.getReal([FORCE, LOAD_1, LOAD_1 + 1, MASS]) == [2.0, 3.0, 0.0, 1.0]
        assert slave.fmu.getReal([WEIGHT_1, WEIGHT_2]) == [1.0, 0.5]
        assert slave.fmu.getInteger(INTEGERS) == [9, 0, 0, 0, 2, 10]
        assert slave.fmu.getBoolean(BOOLEANS) == [1, 0, 0, 1]


@pytest.mark.parametrize(("function", "reference", "message"), [
    ("setReal", MASS, "parameter mass is fixed in step mode; set it before initialization ends, or reset the FMU"),
    ("setReal", WEIGHT_2, "parameter weights[2] is fixed in step mode"),
    ("setReal", POSITION, "position is calculated by the model and cannot be set; set parameters and inputs"),
    ("setReal", HISTORY_1 + 3, "history[4] is calculated by the model"),
    ("setReal", VELOCITY, "velocity is calculated by the model"),
    ("setReal", ENABLED, "value reference 3 is not of type float in this FMU"),
    ("setInteger", FORCE, "value reference 0 is not of type int in this FMU"),
    ("setBoolean", 24, "value reference 24 is not of type bool in this FMU"),
    ("setInteger", LIMIT, "parameter limit is fixed in step mode"),
])
def test_what_cannot_be_set_is_refused_by_name(function: str, reference: int, message: str) -> None:
    with slave2() as slave:
        slave.initialize()
        before = slave.everything()
        with pytest.raises(FMICallException, match="error"):
            getattr(slave.fmu, function)([reference], [1])
        assert message in slave.log[-1][2]
        assert slave.everything() == before


@pytest.mark.parametrize("reference", [ENABLED, STEPS, 24, 2**32 - 1])
def test_wrong_reference_is_refused_when_getting(reference: int) -> None:
    with slave2() as slave:
        slave.initialize()
        assert status(slave, "fmi2GetReal", references(reference), 1, reals(0.0)) == ERROR
        assert slave.log[-1][2] == f"value reference {reference} is not of type float in this FMU"


def test_missing_arrays_are_refused() -> None:
    for function in ("fmi2GetReal", "fmi2SetReal"):
        for arguments in ((None, 1, reals(1.0)), (references(FORCE), 1, None)):
            with slave2() as slave:
                slave.initialize()
                assert status(slave, function, *arguments) == ERROR
                assert "NULL" in slave.log[-1][2]
            with slave2() as slave:
                slave.initialize()
                assert status(slave, function, None, 0, None) == OK


def test_output_variables_follow_inputs_while_initializing() -> None:
    with slave2() as slave:
        slave.fmu.enterInitializationMode()
        for force in (1.0, 3.0):
            slave.fmu.setReal([FORCE], [force])
            assert slave.fmu.getReal([POSITION, HISTORY_1 + 3]) == [0.5 * force, 0.5 * force]
        slave.fmu.setReal([FORCE, MASS], [4.0, -1.0])
        assert slave.fmu.getReal([POSITION]) == [1.5]  # cannot be evaluated until the mass is mended
        slave.fmu.setReal([MASS], [1.0])
        assert slave.fmu.getReal([POSITION]) == [2.0]
        slave.fmu.exitInitializationMode()
        assert slave.log == []
