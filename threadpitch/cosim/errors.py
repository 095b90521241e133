"""What can go wrong in co-simulation: one family of exceptions, whose messages are one line each."""

from __future__ import annotations

import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpitch.cosim.result import Result


class CosimError(ValueError):
    """A co-simulation cannot be prepared or continued; the message says what, where and how to mend it."""


class StepError(CosimError):
    """A component could not be computed.

    ``component`` and ``time`` [s] tell where, ``status`` is "discard", "error", "fatal", "nan", "crash" (of an isolated
    component) or "loop" (one that does not come to rest); the master adds ``result``, what was recorded before (None
    where nothing was).
    """

    def __init__(self, message: str, component: str, time: float, status: str) -> None:
        super().__init__(message, component, time, status)  # all of them: errors travel between processes
        self.message = message
        self.component = component
        self.time = time
        self.status = status
        self.result: Result | None = None

    def __str__(self) -> str:
        return self.message


class SimulationInterrupted(KeyboardInterrupt):
    """Ctrl-C, SIGTERM or SIGHUP (``signal``) ended a run between two steps; everything is freed.

    ``result`` is what was recorded until then.
    """

    def __init__(self, time: float, number: int = signal.SIGINT) -> None:
        super().__init__(time, number)
        self.time = time
        self.signal = number
        self.result: Result | None = None

    def __str__(self) -> str:
        return f"interrupted at t = {self.time:.9g} s"


class TimeLimitError(CosimError):
    """A run took longer than allowed and was ended between two steps. ``result`` is what was recorded until then."""

    def __init__(self, time: float, limit: float) -> None:
        super().__init__(time, limit)
        self.time = time
        self.limit = limit
        self.result: Result | None = None

    def __str__(self) -> str:
        return (f"the run reached t = {self.time:.9g} s in the {self.limit:g} s that it was given; allow more, or take "
                "a larger step")
