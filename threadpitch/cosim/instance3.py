"""FMUs of FMI 3.0 for co-simulation, without event mode and early return, for which see ``event_mode``."""

from __future__ import annotations

import ctypes
import os
from typing import Any, ClassVar

import numpy as np
from fmpy.fmi3 import FMU3Slave, fmi3IntermediateUpdateCallback

from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.instance import FmuInstance, Library, Polynomials, References, Transfer, Values
from threadpitch.cosim.intermediate import Updater
from threadpitch.cosim.messages import DISCARD, WARNING


class FmuInstance3(FmuInstance):
    """An FMU of FMI 3.0. ``followed`` are the inputs that are set in its intermediate updates."""

    prefix = "fmi3"
    event_mode: ClassVar[bool] = False

    def __init__(self, name: str, library: Library, followed: References | None = None) -> None:
        self._followed = np.zeros(0, np.uint32) if followed is None else followed
        self._updater: Updater | None = Updater() if self._followed.size else None
        super().__init__(name, library)
        self._do_step: Any = self.dll.fmi3DoStep
        self._start_time = 0.0
        self._event, self._ended, self._early = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool()
        self._reached = ctypes.c_double()
        self._answers = (ctypes.byref(self._event), ctypes.byref(self._ended), ctypes.byref(self._early),
                         ctypes.byref(self._reached))

    def _load(self, description: FmuDescription) -> Any:
        return FMU3Slave(guid=description.guid, modelIdentifier=description.model_identifier,
                         unzipDirectory=str(description.folder), instanceName=self.name)

    def _instantiate(self, description: FmuDescription) -> int:
        function = self._fmu.dll.fmi3InstantiateCoSimulation
        resources = str(description.folder / "resources") + os.path.sep  # FMI 3.0.2, 2.3.1: ends with a separator
        updater = self._updater
        component = function(
            self.name.encode(), description.guid.encode(), resources.encode(), False, True,
            self.event_mode, self.event_mode,
            self._followed.ctypes.data_as(function.argtypes[7]), self._followed.size,
            None if updater is None else updater.environment, self.messages.log_message,
            fmi3IntermediateUpdateCallback(0 if updater is None else updater.callback))
        if not component:
            raise RuntimeError("fmi3InstantiateCoSimulation gave no instance")
        return int(component)

    def value_count(self, values: Values) -> tuple[int, ...]:
        """The number of values, which arrays make larger than that of the variables."""
        return (values.size,)

    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """A call that sets the inputs' values; the FMU asks for more in its intermediate updates (FMI 3.0, 4.2.2)."""
        assert self._updater is not None
        self._updater.bind(self, references, polynomials)
        return self.setter(c_type, references, polynomials.values)

    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""
        references, texts = (ctypes.c_uint * 1)(reference), (ctypes.c_char_p * 1)(text.encode())
        self.check(self.dll.fmi3SetString(self.component, references, 1, texts, 1), "fmi3SetString failed")

    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds; FMI 3.0 hears of it when initialisation begins."""
        self.time = self._start_time = start_time

    def enter_initialization(self) -> None:
        """Begin initialisation; no stop time, as for FMI 2.0."""
        status = self.dll.fmi3EnterInitializationMode(self.component, False, 0.0, self._start_time, False, 0.0)
        self.check(status, "initialisation failed")

    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size``."""
        self.time = time
        status = self._do_step(self.component, time, step_size, self.final, *self._answers)
        if status > WARNING or self._ended.value:
            self.fail_step(status)

    def fail_step(self, status: int) -> None:
        """Raise the ``StepError`` of a step that failed, or in which the FMU asked to end the run."""
        self.fail(status if status > WARNING else DISCARD, "the step failed")

    def answer(self, ended: bool, reached: float) -> None:
        """Take over what fmi3DoStep answered to somebody else who called it."""
        self._ended.value, self._reached.value = ended, reached

    def _discarded(self) -> tuple[str, str]:
        asked = "the FMU asks to end the run" if self._ended.value else ""
        detail = f", computed up to {self._reached.value:.9g} s" if self._reached.value > self.time else ""
        return detail, asked

