"""The log messages of FMUs, kept per instance instead of printed.

FMI 2.0 loggers are variadic, which ctypes cannot receive: FMPy's native proxy formats the text first. The proxy knows
one receiver per process, so there is one here, which finds the instance by its componentEnvironment. FMI 3.0 hands
over whole texts, so each instance has a receiver of its own.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import logging
import weakref
from collections import Counter, deque
from dataclasses import dataclass
from typing import Any

import fmpy
from fmpy import fmi2, fmi3

LIMIT = 200  # messages kept per instance: an FMU that logs every step must not fill the memory
WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4  # fmi2Status, fmi3Status
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Message:
    """One log message; ``status`` is the fmi2Status that it was logged with, ``text`` is one line."""

    status: int
    category: str
    text: str


class Messages:
    """The last messages of one instance, and the C callbacks that bring them.

    ``callbacks`` (FMI 2.0) and ``log_message`` (FMI 3.0) must live as long as the FMU's instance, which keeps pointers
    to them.
    """

    def __init__(self, instance_name: str) -> None:
        self.instance_name = instance_name
        self.kept: deque[Message] = deque(maxlen=LIMIT)
        self._warned: Counter[str] = Counter()
        self._more = 0  # warnings of which there were too many different ones
        key = next(_keys)
        _receivers[key] = self
        self.callbacks: Any = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = _logger
        # libc's own functions: no detour through Python for every allocation of an FMU.
        self.callbacks.allocateMemory = ctypes.cast(fmpy.calloc, fmi2.fmi2CallbackAllocateMemoryTYPE)
        self.callbacks.freeMemory = ctypes.cast(fmpy.free, fmi2.fmi2CallbackFreeMemoryTYPE)
        self.callbacks.componentEnvironment = key
        proxy = getattr(fmi2, "addLoggerProxy", None)
        self.log_message: Any = fmi3.fmi3LogMessageCallback(functools.partial(_receive3, weakref.ref(self)))
        if proxy is not None:  # FMPy has no proxy for every platform: messages then keep their %s
            proxy(ctypes.byref(self.callbacks))

    def keep(self, message: Message) -> None:
        """Add a message; the oldest goes when there are too many. A warning is logged when it comes first."""
        self.kept.append(message)
        if message.status != WARNING:
            return
        if message.text not in self._warned and len(self._warned) == LIMIT:
            self._more += 1
            return
        self._warned[message.text] += 1
        if self._warned[message.text] == 1:
            _log.warning("%s: %s", self.instance_name, message.text)

    def forget(self) -> None:
        """Forget all messages, before another run."""
        self.kept.clear()
        self._warned.clear()
        self._more = 0

    def reason(self) -> str:
        """The last message of a failure, else the last of all; empty where there is none."""
        failures = [message.text for message in self.kept if message.status >= DISCARD]
        texts = failures or [message.text for message in self.kept]
        return texts[-1] if texts else ""

    def reasons(self) -> str:
        """The last few messages of failures: the last alone may tell only that there was one."""
        failures = [message.text for message in self.kept if message.status >= DISCARD]
        return "; ".join(list(dict.fromkeys(failures))[-3:]) or self.reason()

    def warnings(self) -> tuple[str, ...]:
        """The texts of the messages that were logged as warnings, each once, with how often it came."""
        texts = [text if count == 1 else f"{text} ({count} times)" for text, count in self._warned.items()]
        return (*texts, f"and {self._more} more warnings") if self._more else tuple(texts)


_keys = itertools.count(1)
_receivers: weakref.WeakValueDictionary[int, Messages] = weakref.WeakValueDictionary()


def _receive(environment: int | None, name: bytes | None, status: int, category: bytes | None,
             text: bytes | None) -> None:
    receiver = _receivers.get(environment or 0)
    if receiver is None:  # an FMU that does not hand the environment back
        wanted = _text(name)
        receiver = next((found for found in _receivers.values() if found.instance_name == wanted), None)
    if receiver is not None:
        receiver.keep(Message(status, _text(category), " ".join(_text(text).split())))


def _text(raw: bytes | None) -> str:
    return "" if raw is None else raw.decode("utf-8", errors="replace")


def _receive3(receiver: weakref.ref[Messages], environment: int | None, status: int, category: bytes | None,
              text: bytes | None) -> None:
    messages = receiver()
    if messages is not None:
        messages.keep(Message(status, _text(category), " ".join(_text(text).split())))


_logger = fmi2.fmi2CallbackLoggerTYPE(_receive)
