"""The state of an FMU as bytes, which another process may go on from (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.6.4)."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from threadpitch.cosim.instance import FmuInstance

# Every argument of these functions is an address or a size.
_NAMES: dict[str, tuple[str, str, int]] = {  # by FMI version 2 and 3, and the number of arguments
    "get": ("GetFMUstate", "GetFMUState", 2),
    "set": ("SetFMUstate", "SetFMUState", 2),
    "free": ("FreeFMUstate", "FreeFMUState", 2),
    "size": ("SerializedFMUstateSize", "SerializedFMUStateSize", 3),
    "serialize": ("SerializeFMUstate", "SerializeFMUState", 4),
    "deserialize": ("DeSerializeFMUstate", "DeserializeFMUState", 4),
}


def save_state(instance: FmuInstance) -> bytes:
    """All that the instance holds now: its variables, its memory, the values that were set last.

    Raises:
        StepError: the FMU does not give its state.
    """
    state, size = ctypes.c_void_p(), ctypes.c_size_t()
    _call(instance, "get", ctypes.byref(state))
    try:
        _call(instance, "size", state, ctypes.byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        _call(instance, "serialize", state, buffer, size.value)
    finally:
        _free(instance, state)
    return buffer.raw


def load_state(instance: FmuInstance, serialized: bytes) -> None:
    """Make the instance what it was when these bytes were saved.

    Raises:
        StepError: the FMU does not take them.
    """
    state = ctypes.c_void_p()
    buffer = ctypes.create_string_buffer(serialized, len(serialized))
    _call(instance, "deserialize", buffer, len(serialized), ctypes.byref(state))
    try:
        _call(instance, "set", state)
    finally:
        _free(instance, state)


def _free(instance: FmuInstance, state: ctypes.c_void_p) -> None:
    if not instance.library.fatal:  # after that nothing may be called
        _function(instance, "free")(instance.component, ctypes.byref(state))


def _call(instance: FmuInstance, word: str, *arguments: Any) -> None:
    instance.check(_function(instance, word)(instance.component, *arguments), f"{_name(instance, word)} failed")


def _function(instance: FmuInstance, word: str) -> Any:
    prototype = ctypes.CFUNCTYPE(ctypes.c_int, *[ctypes.c_void_p] * _NAMES[word][2])
    return ctypes.cast(getattr(instance.dll, _name(instance, word)), prototype)


def _name(instance: FmuInstance, word: str) -> str:
    of_2, of_3, _ = _NAMES[word]
    return instance.prefix + (of_2 if instance.prefix == "fmi2" else of_3)
