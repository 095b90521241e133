"""What the master steps: anything with the interface ``Instance``; ``FmuInstance`` makes an FMI 2.0 FMU such a thing.

Values pass in bulk through arrays that are allocated once: ``setter`` and ``getter`` bind value references to an array
and return the call that moves the values, so that nothing is built in a step.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Callable
from typing import Any, Protocol, TypeAlias

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from numpy.typing import NDArray

from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.messages import DISCARD, ERROR, FATAL, WARNING, Messages

References: TypeAlias = NDArray[np.uint32]
Values: TypeAlias = NDArray[Any]  # float64 for Real, int32 for Integer and Boolean
Transfer: TypeAlias = Callable[[], None]
KINDS = ("Real", "Integer", "Boolean")  # the kinds of values that are exchanged in a step
DTYPES: dict[str, type[np.generic]] = {"Real": np.float64, "Integer": np.int32, "Boolean": np.int32}

_POINTERS: dict[str, Any] = {"Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int}
_STATUS = {DISCARD: "discard", ERROR: "error", FATAL: "fatal"}
_TERMINATED, _LAST_SUCCESSFUL_TIME = 3, 2  # fmi2StatusKind


class Instance(Protocol):
    """A component while it runs. Calls follow FMI 2.0: set, set up, enter and exit initialisation, steps, end.

    Every call may raise ``StepError``, except ``terminate`` and ``free``, which end what can be ended and may be
    called in any state.
    """

    name: str

    def setter(self, kind: str, references: References, values: Values) -> Transfer:
        """A call that copies ``values`` (n,) into the variables ``references`` (n,); bound once, called every step."""

    def getter(self, kind: str, references: References, values: Values) -> Transfer:
        """A call that copies the variables ``references`` (n,) into ``values`` (n,)."""

    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""

    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds."""

    def enter_initialization(self) -> None:
        """Begin initialisation: inputs can be set, outputs be asked for."""

    def exit_initialization(self) -> None:
        """End initialisation: parameters hold from here on."""

    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size`` with the inputs that were set."""

    def terminate(self) -> None:
        """End the run."""

    def free(self) -> None:
        """Give everything back."""

    def warnings(self) -> tuple[str, ...]:
        """What the component warned of, oldest first."""


class Library:
    """What the instances of one FMU share: after fmi2Fatal none of them may be called again (FMI 2.0, 2.1.3)."""

    def __init__(self, description: FmuDescription) -> None:
        self.description = description
        self.fatal = False


class FmuInstance:
    """An FMI 2.0 co-simulation FMU, loaded by FMPy, called directly.

    Raises (the class itself):
        StepError: the library cannot be loaded, or the FMU does not instantiate.
    """

    def __init__(self, name: str, library: Library) -> None:
        self.name = name
        self.messages = Messages(name)
        self._library = library
        self._time = 0.0
        self._state = "loaded"  # instantiated, initialized, discarded, error, terminated, freed
        description = library.description
        try:
            with contextlib.chdir(os.getcwd()):  # FMPy changes it while loading, and leaves it so on failure
                self._fmu: Any = FMU2Slave(
                    guid=description.guid, modelIdentifier=description.model_identifier,
                    unzipDirectory=str(description.folder), instanceName=name)
            self._dll: Any = self._fmu.dll
            self._fmu.instantiate(callbacks=self.messages.callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises plain Exception
            reason = self.messages.reason() or " ".join(str(error).split())
            raise StepError(f"{name}: {description.path.name} cannot be instantiated: {reason}",
                            component=name, time=self._time, status="error") from None
        self._state = "instantiated"
        self._component = self._fmu.component
        self._do_step: Any = self._dll.fmi2DoStep
        self._quieten()

    def _quieten(self) -> None:
        """Of an FMU that has log categories for debugging, ask for failures and warnings only: the rest costs time.

        Others log all they have: PythonFMU tells of an exception without a category, which naming some would silence.
        """
        names = self._library.description.log_categories
        wanted = [name.encode() for name in names if name.startswith("logStatus")]
        if wanted and len(wanted) + ("logAll" in names) < len(names):
            categories = (ctypes.c_char_p * len(wanted))(*wanted)
            self._dll.fmi2SetDebugLogging(self._component, 1, len(wanted), categories)

    def setter(self, kind: str, references: References, values: Values) -> Transfer:
        """A call that copies ``values`` (n,) into the variables ``references`` (n,)."""
        return self._transfer(f"fmi2Set{kind}", kind, references, values)

    def getter(self, kind: str, references: References, values: Values) -> Transfer:
        """A call that copies the variables ``references`` (n,) into ``values`` (n,)."""
        return self._transfer(f"fmi2Get{kind}", kind, references, values)

    def _transfer(self, function_name: str, kind: str, references: References, values: Values) -> Transfer:
        function, component, fail = getattr(self._dll, function_name), self._component, self._fail
        count = references.size
        # data_as keeps the array alive with the pointer
        reference_pointer = references.ctypes.data_as(ctypes.POINTER(ctypes.c_uint))
        value_pointer = values.ctypes.data_as(ctypes.POINTER(_POINTERS[kind]))

        def transfer() -> None:
            status = function(component, reference_pointer, count, value_pointer)
            if status > WARNING:
                fail(status, f"{function_name} failed")

        return transfer

    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""
        references, texts = (ctypes.c_uint * 1)(reference), (ctypes.c_char_p * 1)(text.encode())
        self._check(self._dll.fmi2SetString(self._component, references, 1, texts), "fmi2SetString failed")

    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds.

        No stop time: the last step may end one rounding error behind it, which some FMUs take for a fault.
        """
        self._time = start_time
        status = self._dll.fmi2SetupExperiment(self._component, 0, 0.0, start_time, 0, 0.0)
        self._check(status, "the experiment cannot be set up")

    def enter_initialization(self) -> None:
        """Begin initialisation."""
        self._check(self._dll.fmi2EnterInitializationMode(self._component), "initialisation failed")

    def exit_initialization(self) -> None:
        """End initialisation."""
        self._check(self._dll.fmi2ExitInitializationMode(self._component), "initialisation failed")
        self._state = "initialized"

    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size``; the master never steps back."""
        self._time = time
        status = self._do_step(self._component, time, step_size, 1)
        if status > WARNING:
            self._fail(status, "the step failed")

    def _check(self, status: int, what: str) -> None:
        if status > WARNING:
            self._fail(status, what)

    def _fail(self, status: int, what: str) -> None:
        reason = self.messages.reason()  # before the FMU is asked for more, which may log
        label, detail = _STATUS.get(status, "error"), ""
        if status == FATAL:
            self._library.fatal = True
        elif status == DISCARD and self._state == "initialized":
            detail, asked = self._discarded()
            reason = reason or asked
        reason = reason.removeprefix(f"{self.name}: ") or "the FMU gave no reason"
        self._state = "discarded" if status == DISCARD and self._state == "initialized" else "error"
        raise StepError(f"{self.name}: {what} at t = {self._time:.9g} s ({label}{detail}): {reason}",
                        component=self.name, time=self._time, status=label)

    def _discarded(self) -> tuple[str, str]:
        """How far a discarded step came, and whether the FMU wants to end (FMI 2.0, 4.2.2); empty where not."""
        ended, reached = ctypes.c_int(0), ctypes.c_double(0.0)
        status = self._dll.fmi2GetBooleanStatus(self._component, _TERMINATED, ctypes.byref(ended))
        asked = "the FMU asks to end the run" if status <= WARNING and ended.value else ""
        status = self._dll.fmi2GetRealStatus(self._component, _LAST_SUCCESSFUL_TIME, ctypes.byref(reached))
        if status <= WARNING and reached.value > self._time:
            return f", computed up to {reached.value:.9g} s", asked
        return "", asked

    def terminate(self) -> None:
        """End the run, where FMI 2.0 allows the call (4.2.4: after a step, discarded or not)."""
        if self._state in ("initialized", "discarded") and not self._library.fatal:
            status = self._dll.fmi2Terminate(self._component)
            self._library.fatal |= status == FATAL
            self._state = "terminated"

    def free(self) -> None:
        """Free the instance and unload the library; after fmi2Fatal both are left alone, as any call may crash."""
        if self._state != "freed" and not self._library.fatal:
            self._dll.fmi2FreeInstance(self._component)
            fmpy.freeLibrary(self._dll._handle)
        self._state = "freed"

    def warnings(self) -> tuple[str, ...]:
        """What the FMU logged as warnings, oldest first."""
        return self.messages.warnings()
