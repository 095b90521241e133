"""Ctrl-C while FMUs compute: noted, and acted upon between two steps.

An FMU that runs Python in this process would otherwise receive the KeyboardInterrupt inside of its own step, and
answer with fmi2Fatal.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType


class HeldInterrupt:
    """A context in which the first Ctrl-C only sets ``requested``; the second interrupts at once.

    Signal handlers belong to the main thread, and a handler that somebody else has set is left in its place.
    """

    def __init__(self) -> None:
        self.requested = False
        self._held = False

    def __enter__(self) -> HeldInterrupt:
        if (threading.current_thread() is threading.main_thread()
                and signal.getsignal(signal.SIGINT) is signal.default_int_handler):
            signal.signal(signal.SIGINT, self._note)
            self._held = True
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._held:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            self._held = False

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True
