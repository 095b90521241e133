"""What the master steps: anything with the interface ``Instance``; ``FmuInstance`` is what loaded FMUs share.

Values pass in bulk through arrays that are allocated once: ``setter`` and ``getter`` bind value references to an array
and return the call that moves the values, so that nothing is built in a step.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn, Protocol, TypeAlias

import fmpy
import numpy as np
from numpy.typing import NDArray

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.fmu_state import load_state, save_state
from threadpitch.cosim.messages import DISCARD, FATAL, WARNING, Messages
from threadpitch.cosim.state_slot import FmuSlot, Slot

References: TypeAlias = NDArray[np.uint32]
Values: TypeAlias = NDArray[Any]  # of the C type's dtype
Transfer: TypeAlias = Callable[[], None]

_STATUS = {DISCARD: "discard", FATAL: "fatal"}


@dataclass(frozen=True)
class Polynomials:
    """Inputs as polynomials of the time since the step's beginning.

    u(start + tau) = values + derivatives[0] tau + derivatives[1] tau^2 / 2

    ``values`` (n,) and ``derivatives`` (order, n) are read when a step begins, ``start`` (1,) is its time, seconds.
    """

    values: NDArray[np.float64]
    derivatives: NDArray[np.float64]
    start: NDArray[np.float64]


class Instance(Protocol):
    """A component while it runs. Calls follow FMI: set, set up, enter and exit initialisation, steps, end.

    Every call may raise ``StepError``, except ``terminate`` and ``free``, which end what can be ended and may be
    called in any state.
    """

    name: str

    def setter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies ``values`` (n,) into the variables ``references`` (r,); bound once, called every step.

        Of an array of FMI 3.0 all elements are set, so that n may exceed r.
        """

    def getter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies the variables ``references`` (r,) into ``values`` (n,)."""

    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """A call that makes the inputs ``references`` (r,) follow polynomials in the next step."""

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

    def save_state(self) -> bytes:
        """All that the component holds between two steps, as bytes that another process can go on from."""

    def load_state(self, serialized: bytes) -> None:
        """Make the initialised component what it was when these bytes were saved."""

    def slot(self) -> Slot:
        """A place for the component's state, to which it then returns; taken before the first step."""

    def terminate(self) -> None:
        """End the run."""

    def free(self) -> None:
        """Give everything back."""

    def warnings(self) -> tuple[str, ...]:
        """What the component warned of, oldest first."""


class Library:
    """What the instances of one FMU share: after a fatal status none of them may be called again (FMI 2.0, 2.1.3)."""

    def __init__(self, description: FmuDescription) -> None:
        self.description = description
        self.fatal = False


class FmuInstance(ABC):
    """An FMU for co-simulation, loaded by FMPy, called directly. A subclass for each FMI version.

    ``time`` is the beginning of the last step that was asked for.

    Raises (the class itself):
        StepError: the library cannot be loaded, or the FMU does not instantiate.
    """

    prefix: ClassVar[str]

    def __init__(self, name: str, library: Library) -> None:
        self.name = name
        self.messages = Messages(name)
        self.time = 0.0
        self.library = library
        self.slots: list[FmuSlot] = []
        self._state = "loaded"  # instantiated, initialized, discarded, error, terminated, freed
        description = library.description
        try:
            with contextlib.chdir(os.getcwd()):  # FMPy changes it while loading, and leaves it so on failure
                self._fmu: Any = self._load(description)
            self.dll: Any = self._fmu.dll
            self.component: int = self._instantiate(description)
        except Exception as error:  # FMPy raises plain Exception
            # Where it was unpacked to tells nobody anything: the folder is gone when the message is read.
            said = str(error).replace(f"{description.folder}{os.sep}", "")
            reason = self.messages.reasons() or " ".join(said.split())
            raise StepError(f"{name}: {description.path.name} cannot be instantiated: {reason}",
                            component=name, time=self.time, status="error") from None
        self._state = "instantiated"
        self._quieten(description.log_categories)

    @abstractmethod
    def _load(self, description: FmuDescription) -> Any:
        """FMPy's object with the library."""

    @abstractmethod
    def _instantiate(self, description: FmuDescription) -> int:
        """The address of the new instance."""

    def _quieten(self, names: Sequence[str]) -> None:
        """Of an FMU that has log categories for debugging, ask for failures and warnings only: the rest costs time.

        Others log all they have: PythonFMU tells of an exception without a category, which naming some would silence.
        """
        wanted = [name.encode() for name in names if name.startswith("logStatus")]
        if wanted and len(wanted) + ("logAll" in names) < len(names):
            categories = (ctypes.c_char_p * len(wanted))(*wanted)
            self.function("SetDebugLogging")(self.component, True, len(wanted), categories)

    def function(self, name: str) -> Any:
        """The C function ``fmi2<name>`` or ``fmi3<name>``."""
        return getattr(self.dll, self.prefix + name)

    # Values

    def setter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies ``values`` (n,) into the variables ``references`` (r,)."""
        return self.transfer(C_TYPES[c_type].setter, references, values)

    def getter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies the variables ``references`` (r,) into ``values`` (n,)."""
        return self.transfer(C_TYPES[c_type].getter, references, values)

    def transfer(self, function_name: str, references: References, values: Values) -> Transfer:
        """A call of a get or set function."""
        function, component, fail = getattr(self.dll, function_name), self.component, self.fail
        # data_as keeps the array alive with the pointer
        reference_pointer = references.ctypes.data_as(function.argtypes[1])
        value_pointer = values.ctypes.data_as(function.argtypes[3])
        rest = self.value_count(values)
        count = references.size

        def transfer() -> None:
            status = function(component, reference_pointer, count, value_pointer, *rest)
            if status > WARNING:
                fail(status, f"{function_name} failed")

        return transfer

    @abstractmethod
    def value_count(self, values: Values) -> tuple[int, ...]:
        """What get and set functions of this FMI version take behind the values."""

    @abstractmethod
    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """A call that makes the inputs ``references`` (r,) follow polynomials in the next step."""

    @abstractmethod
    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""

    # Life

    @abstractmethod
    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds."""

    @abstractmethod
    def enter_initialization(self) -> None:
        """Begin initialisation."""

    @abstractmethod
    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size``."""

    @property
    def final(self) -> bool:
        """noSetFMUStatePriorToCurrentPoint: whether the master never steps back."""
        return not self.slots

    def slot(self) -> FmuSlot:
        """A place for the FMU's state; from now on it hears that the master may step back."""
        self.slots.append(FmuSlot(self))
        return self.slots[-1]

    def go_back(self) -> None:
        """The state was restored: a step that was discarded is as if it had not been."""
        if self._state == "discarded":
            self._state = "initialized"

    def reset(self) -> None:
        """Make the instance what it was when it was new (FMI 2.0.5, 2.1.6; FMI 3.0.2, 2.2.5); not after a failure."""
        self.check(self.function("Reset")(self.component), "the FMU cannot be reset")
        self.messages.forget()
        self.time, self._state = 0.0, "instantiated"

    def exit_initialization(self) -> None:
        """End initialisation."""
        self.check(self.function("ExitInitializationMode")(self.component), "initialisation failed")
        self._state = "initialized"

    def check(self, status: int, what: str) -> None:
        """Raise a ``StepError`` when a status says that the call failed."""
        if status > WARNING:
            self.fail(status, what)

    def fail(self, status: int, what: str) -> NoReturn:
        """Raise the ``StepError`` of a status; the reason is what the FMU logged."""
        reason = self.messages.reason()  # before the FMU is asked for more, which may log
        label, detail = _STATUS.get(status, "error"), ""
        if status == FATAL:
            self.library.fatal = True
        elif status == DISCARD and self._state == "initialized":
            detail, asked = self._discarded()
            reason = reason or asked
        reason = reason.removeprefix(f"{self.name}: ") or "the FMU gave no reason"
        self._state = "discarded" if status == DISCARD and self._state == "initialized" else "error"
        raise StepError(f"{self.name}: {what} at t = {self.time:.9g} s ({label}{detail}): {reason}",
                        component=self.name, time=self.time, status=label)

    @abstractmethod
    def _discarded(self) -> tuple[str, str]:
        """How far a discarded step came, and whether the FMU wants to end; empty where not."""

    def save_state(self) -> bytes:
        """All that the component holds between two steps, as bytes that another process can go on from."""
        return save_state(self)

    def load_state(self, serialized: bytes) -> None:
        """Make the initialised component what it was when these bytes were saved."""
        load_state(self, serialized)

    def terminate(self) -> None:
        """End the run, where FMI allows the call (FMI 2.0, 4.2.4: after a step, discarded or not)."""
        if self._state in ("initialized", "discarded") and not self.library.fatal:
            status = self.function("Terminate")(self.component)
            self.library.fatal |= status == FATAL
            self._state = "terminated"

    def free(self) -> None:
        """Free the instance and unload the library; after a fatal status both are left alone: any call may crash."""
        if self._state != "freed":
            if not self.library.fatal:
                for slot in self.slots:
                    slot.free()
                self.function("FreeInstance")(self.component)
            # PythonFMU's libraries stay loaded, and touch freed memory when the process ends, unless they are told.
            finalize = getattr(self.dll, "finalizePythonInterpreter", None)
            if finalize is not None:
                finalize()
            if not self.library.fatal:
                fmpy.freeLibrary(self.dll._handle)
        self._state = "freed"

    def warnings(self) -> tuple[str, ...]:
        """What the FMU logged as warnings, oldest first."""
        return self.messages.warnings()
