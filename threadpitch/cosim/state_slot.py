"""A place for the state of an instance, to which it can return (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.6.4)."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from threadpitch.cosim.instance import FmuInstance, Instance


class Slot(Protocol):
    """Holds one state, in memory."""

    def save(self) -> None:
        """Keep the instance's state, in place of that which was kept before."""

    def restore(self) -> None:
        """Make the instance what it was when its state was kept."""


class FmuSlot:
    """A state that the FMU allocates once and reuses; ``address`` is where its handle lies."""

    def __init__(self, instance: FmuInstance) -> None:
        self._instance = instance
        self._handle = ctypes.c_void_p()
        suffix = "state" if instance.prefix == "fmi2" else "State"
        self._names = [f"{word}FMU{suffix}" for word in ("Get", "Set", "Free")]
        prototype = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)
        self._get, self._set, self._free = (prototype(self.function_address(name)) for name in self._names)
        self.address = ctypes.addressof(self._handle)

    def function_address(self, name: str) -> int:
        """Where the FMU's function lies."""
        function: Any = self._instance.function(name)
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    @property
    def functions(self) -> tuple[int, int]:
        """The addresses of the functions that get and set a state."""
        return self.function_address(self._names[0]), self.function_address(self._names[1])

    def save(self) -> None:
        """Keep the instance's state."""
        status = self._get(self._instance.component, self.address)
        self._instance.check(status, f"{self._instance.prefix}{self._names[0]} failed")

    def restore(self) -> None:
        """Make the instance what it was."""
        status = self._set(self._instance.component, self._handle)
        self._instance.check(status, f"{self._instance.prefix}{self._names[1]} failed")
        self._instance.go_back()

    def free(self) -> None:
        """Give the state back to the FMU."""
        if self._handle.value:
            self._free(self._instance.component, self.address)


class SerializedSlot:
    """A state as bytes, of an instance that gives no other."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._kept = b""

    def save(self) -> None:
        """Keep the instance's state."""
        self._kept = self._instance.save_state()

    def restore(self) -> None:
        """Make the instance what it was."""
        self._instance.load_state(self._kept)
