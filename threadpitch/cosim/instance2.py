"""FMUs of FMI 2.0 for co-simulation."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from fmpy.fmi2 import FMU2Slave

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.instance import FmuInstance, Library, Polynomials, References, Transfer, Values
from threadpitch.cosim.messages import WARNING

_TERMINATED, _LAST_SUCCESSFUL_TIME = 3, 2  # fmi2StatusKind


class FmuInstance2(FmuInstance):
    """An FMU of FMI 2.0."""

    prefix = "fmi2"

    def __init__(self, name: str, library: Library) -> None:
        super().__init__(name, library)
        self._do_step: Any = self.dll.fmi2DoStep

    def _load(self, description: FmuDescription) -> Any:
        return FMU2Slave(guid=description.guid, modelIdentifier=description.model_identifier,
                         unzipDirectory=str(description.folder), instanceName=self.name)

    def _instantiate(self, description: FmuDescription) -> int:
        self._fmu.instantiate(callbacks=self.messages.callbacks, loggingOn=True)
        return int(self._fmu.component)

    def value_count(self, values: Values) -> tuple[int, ...]:
        """Nothing: every variable is a scalar."""
        return ()

    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """A call that sets the inputs' values and their derivatives (FMI 2.0, 4.2.1)."""
        set_values = self.setter(c_type, references, polynomials.values)
        set_derivatives = self.transfer_derivatives(references, polynomials)

        def follow() -> None:
            set_values()
            set_derivatives()

        return follow

    def transfer_derivatives(self, references: References, polynomials: Polynomials) -> Transfer:
        """The call of fmi2SetRealInputDerivatives with all orders at once."""
        function, component, fail = self.dll.fmi2SetRealInputDerivatives, self.component, self.fail
        repeated, orders = derivative_arguments(references, polynomials.derivatives)
        reference_pointer = repeated.ctypes.data_as(function.argtypes[1])
        order_pointer = orders.ctypes.data_as(function.argtypes[3])
        value_pointer = polynomials.derivatives.ctypes.data_as(function.argtypes[4])
        count = repeated.size

        def transfer() -> None:
            status = function(component, reference_pointer, count, order_pointer, value_pointer)
            if status > WARNING:
                fail(status, "fmi2SetRealInputDerivatives failed")

        return transfer

    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""
        references, texts = (ctypes.c_uint * 1)(reference), (ctypes.c_char_p * 1)(text.encode())
        self.check(self.dll.fmi2SetString(self.component, references, 1, texts), "fmi2SetString failed")

    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds.

        No stop time: the last step may end one rounding error behind it, which some FMUs take for a fault.
        """
        self.time = start_time
        status = self.dll.fmi2SetupExperiment(self.component, 0, 0.0, start_time, 0, 0.0)
        self.check(status, "the experiment cannot be set up")

    def enter_initialization(self) -> None:
        """Begin initialisation."""
        self.check(self.dll.fmi2EnterInitializationMode(self.component), "initialisation failed")

    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size``."""
        self.time = time
        status = self._do_step(self.component, time, step_size, self.final)
        if status > WARNING:
            self.fail(status, "the step failed")

    def _discarded(self) -> tuple[str, str]:
        ended, reached = ctypes.c_int(0), ctypes.c_double(0.0)
        status = self.dll.fmi2GetBooleanStatus(self.component, _TERMINATED, ctypes.byref(ended))
        asked = "the FMU asks to end the run" if status <= WARNING and ended.value else ""
        status = self.dll.fmi2GetRealStatus(self.component, _LAST_SUCCESSFUL_TIME, ctypes.byref(reached))
        if status <= WARNING and reached.value > self.time:
            return f", computed up to {reached.value:.9g} s", asked
        return "", asked


def derivative_arguments(references: References, derivatives: Values) -> tuple[References, Values]:
    """Value references and orders (order * n,) that belong to ``derivatives`` (order, n), all of order 1 first."""
    order = derivatives.shape[0]
    orders = np.repeat(np.arange(1, order + 1, dtype=C_TYPES["fmi2Integer"].dtype), references.size)
    return np.tile(references, order), orders
