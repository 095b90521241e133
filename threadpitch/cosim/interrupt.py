"""Ctrl-C, SIGTERM and SIGHUP while FMUs compute: noted, and acted upon between two steps.

An FMU that runs Python in this process would otherwise receive the KeyboardInterrupt inside of its own step, and
answer with fmi2Fatal; and a process that is ended at once leaves its unpacked files behind and its rows unwritten.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, NoReturn, TypeAlias

_Handler: TypeAlias = Callable[[int, FrameType | None], Any] | int | signal.Handlers | None

ENDING = tuple(number for name in ("SIGTERM", "SIGHUP") if (number := getattr(signal, name, None)) is not None)


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP ended the process; ``signal`` is its number."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = number


def end_in_order() -> None:
    """Let SIGTERM and SIGHUP end this process as Ctrl-C does: what is open is closed, temporary folders are removed."""
    for number in ENDING:
        if signal.getsignal(number) is signal.SIG_DFL:  # under nohup, SIGHUP stays ignored
            signal.signal(number, terminate)


def terminate(number: int, frame: FrameType | None) -> NoReturn:
    """The handler that ``end_in_order`` sets."""
    raise Terminated(number)


class HeldInterrupt:
    """A context in which the first signal only sets ``requested`` and ``signal``; the second interrupts at once.

    Signal handlers belong to the main thread, and a handler that somebody else has set is left in its place. Within
    another such context it is told what that one holds.
    """

    def __init__(self) -> None:
        self._told: list[int] = []  # the signal that was held; shared with the contexts within
        self._held: dict[int, _Handler] = {}

    @property
    def requested(self) -> bool:
        """Whether a signal was held."""
        return bool(self._told)

    @property
    def signal(self) -> int:
        """The one that was held first; SIGINT before."""
        return self._told[0] if self._told else int(signal.SIGINT)

    def __enter__(self) -> HeldInterrupt:
        if threading.current_thread() is threading.main_thread():
            ours: dict[int, tuple[_Handler, ...]] = {signal.SIGINT: (signal.default_int_handler,)}
            ours |= dict.fromkeys(ENDING, (signal.SIG_DFL, terminate))
            for number, handlers in ours.items():
                handler = signal.getsignal(number)
                holder = getattr(handler, "__self__", None)
                if isinstance(holder, HeldInterrupt):
                    self._told = holder._told
                elif handler in handlers:
                    signal.signal(number, self._note)
                    self._held[number] = handler
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        for number, handler in self._held.items():
            signal.signal(number, handler)
        self._held.clear()

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._told:
            raise KeyboardInterrupt if number == signal.SIGINT else Terminated(number)
        self._told.append(number)
