"""What FMUs of FMI 3.0 ask for inside of a step: their inputs at any time, from polynomials (FMI 3.0.2, 4.2.2).

The callback is compiled, so that it serves the plain loop and the kernel alike and costs next to nothing.
"""

from __future__ import annotations

import ctypes
import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from threadpitch.cosim.c_types import C_TYPES

if TYPE_CHECKING:
    from threadpitch.cosim.instance import FmuInstance, Polynomials, References

UPDATE = np.dtype([
    ("instance", np.uintp), ("set_values", np.uintp), ("references", np.uintp), ("count", np.uintp),
    ("values", np.uintp), ("derivatives", np.uintp), ("size", np.int64), ("order", np.int64),
    ("start", np.uintp), ("scratch", np.uintp)], align=True)


class Updater:
    """The callback of one instance; ``environment`` is what the FMU hands over to it."""

    def __init__(self) -> None:
        self._update = np.zeros(1, UPDATE)
        self._kept: tuple[object, ...] = ()
        self.environment: int = self._update.ctypes.data
        self.callback: int = _compiled_callback().address

    def bind(self, instance: FmuInstance, references: References, polynomials: Polynomials) -> None:
        """Follow these polynomials from now on."""
        scratch = np.zeros_like(polynomials.values)
        order, size = polynomials.derivatives.shape
        update = self._update[0]
        update["instance"] = instance.component
        update["set_values"] = function_address(getattr(instance.dll, C_TYPES["fmi3Float64"].setter))
        update["references"], update["count"] = references.ctypes.data, references.size
        update["values"], update["derivatives"] = polynomials.values.ctypes.data, polynomials.derivatives.ctypes.data
        update["size"], update["order"] = size, order
        update["start"], update["scratch"] = polynomials.start.ctypes.data, scratch.ctypes.data
        self._kept = (references, polynomials, scratch)


def function_address(function: Any) -> int:
    """Where a C function of a loaded library lies."""
    address = ctypes.cast(function, ctypes.c_void_p).value
    assert address is not None
    return address


@functools.cache
def _compiled_callback() -> Any:
    import numba  # takes its time: only runs that extrapolate inputs of FMI 3.0 need it

    from threadpitch.compiled import compiled_callback
    from threadpitch.cosim.calls import call_five, pointer

    types, carray = numba.types, numba.carray  # type: ignore[attr-defined] # Numba's own types leave it out
    signature = types.void(types.voidptr, types.float64, types.uint8, types.uint8, types.uint8, types.uint8,
                           types.voidptr, types.voidptr)

    def update_inputs(environment: Any, time: float, set_requested: int, _get_allowed: int, _finished: int,
                      _may_return: int, _early: Any, _early_time: Any) -> None:
        """u(start + tau) = u0 + u1 tau + u2 tau^2 / 2, set when the FMU asks for its inputs."""
        update = carray(environment, (1,), UPDATE)[0]
        if set_requested == 0 or update.size == 0:
            return
        tau = time - carray(pointer(update.start), (1,), np.float64)[0]
        values = carray(pointer(update.values), (update.size,), np.float64)
        derivatives = carray(pointer(update.derivatives), (update.order, update.size), np.float64)
        scratch = carray(pointer(update.scratch), (update.size,), np.float64)
        for i in range(update.size):
            change = derivatives[0, i] * tau
            if update.order > 1:
                change += 0.5 * derivatives[1, i] * tau * tau
            scratch[i] = values[i] + change
        call_five(update.set_values, update.instance, update.references, update.count, update.scratch,
                  np.uintp(update.size))

    return compiled_callback(signature)(update_inputs)
