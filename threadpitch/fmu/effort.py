"""A bound on what a model's Python code may do: a loop that does not end is told with its line, not waited for."""

from __future__ import annotations

import sys
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

MOST_LINES = 20_000_000  # a few seconds


class EffortError(RuntimeError):
    """The code ran more lines than it may; ``line`` is where it was."""

    def __init__(self, line: int) -> None:
        super().__init__(f"no end after {MOST_LINES} lines")
        self.line = line


class BoundedEffort:
    """While the context lasts, the lines that this thread runs of one file are counted, and not more than allowed.

    Lines, not seconds: where a run ends does not depend on the machine.
    """

    def __init__(self, path: Path) -> None:
        self.file = str(path)
        self.lines = 0

    def __enter__(self) -> BoundedEffort:
        self.before = sys.gettrace()
        sys.settrace(self._called)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        sys.settrace(self.before)

    def _called(self, frame: FrameType, _event: str, _argument: Any) -> Any:
        return self._counted if frame.f_code.co_filename == self.file else None

    def _counted(self, frame: FrameType, event: str, _argument: Any) -> Any:
        if event == "line":
            self.lines += 1
            if self.lines > MOST_LINES:
                raise EffortError(frame.f_lineno)
        return self._counted
