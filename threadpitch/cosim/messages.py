"""The log messages of FMUs, kept per instance instead of printed.

FMI 2.0 loggers are variadic, which ctypes cannot receive: FMPy's native proxy formats the text first. The proxy knows
one receiver per process, so there is one here, which finds the instance by its componentEnvironment.
"""

from __future__ import annotations

import ctypes
import itertools
from collections import deque
from dataclasses import dataclass
from typing import Any
from weakref import WeakValueDictionary

import fmpy
from fmpy import fmi2

LIMIT = 200  # messages kept per instance: an FMU that logs every step must not fill the memory
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4  # fmi2Status


@dataclass(frozen=True)
class Message:
    """One log message; ``status`` is the fmi2Status that it was logged with, ``text`` is one line."""

    status: int
    category: str
    text: str


class Messages:
    """The last messages of one instance, and the C callbacks that bring them.

    ``callbacks`` must live as long as the FMU's instance: FMI 2.0 hands over a pointer to it.
    """

    def __init__(self, instance_name: str) -> None:
        self.instance_name = instance_name
        self.kept: deque[Message] = deque(maxlen=LIMIT)
        key = next(_keys)
        _receivers[key] = self
        self.callbacks: Any = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = _logger
        # libc's own functions: no detour through Python for every allocation of an FMU.
        self.callbacks.allocateMemory = ctypes.cast(fmpy.calloc, fmi2.fmi2CallbackAllocateMemoryTYPE)
        self.callbacks.freeMemory = ctypes.cast(fmpy.free, fmi2.fmi2CallbackFreeMemoryTYPE)
        self.callbacks.componentEnvironment = key
        proxy = getattr(fmi2, "addLoggerProxy", None)
        if proxy is not None:  # FMPy has no proxy for every platform: messages then keep their %s
            proxy(ctypes.byref(self.callbacks))

    def reason(self) -> str:
        """The last message of a failure, else the last of all; empty where there is none."""
        failures = [message.text for message in self.kept if message.status >= DISCARD]
        texts = failures or [message.text for message in self.kept]
        return texts[-1] if texts else ""

    def warnings(self) -> tuple[str, ...]:
        """The texts of the messages that were logged as warnings."""
        return tuple(message.text for message in self.kept if message.status == WARNING)


_keys = itertools.count(1)
_receivers: WeakValueDictionary[int, Messages] = WeakValueDictionary()


def _receive(environment: int | None, name: bytes | None, status: int, category: bytes | None,
             text: bytes | None) -> None:
    receiver = _receivers.get(environment or 0)
    if receiver is None:  # an FMU that does not hand the environment back
        wanted = _text(name)
        receiver = next((found for found in _receivers.values() if found.instance_name == wanted), None)
    if receiver is not None:
        receiver.kept.append(Message(status, _text(category), " ".join(_text(text).split())))


def _text(raw: bytes | None) -> str:
    return "" if raw is None else raw.decode("utf-8", errors="replace")


_logger = fmi2.fmi2CallbackLoggerTYPE(_receive)
