"""What commands print: results on standard output, progress and messages on standard error."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import NoReturn, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from threadpitch import lathe
from threadpitch.fmu import NO_COMPILER
from threadpitch.tables import printable

BAD_INPUT = 2
CLOSED_PIPE = 1
_SOON = 0.5  # s; what is read in less shows no bar, which would only flicker
_WAITING = 2.0  # s, without anything that is read
_WIDEST_BAR, _NARROWEST_BAR, _BESIDE_THE_BAR = 40, 4, 42  # characters


class progress:  # noqa: N801 -- used as a function: with progress("simulating") as told
    """A bar on standard error while the master tells (steps done, steps in all); nothing where that is no terminal."""

    def __init__(self, label: str) -> None:
        console = Console(stderr=True)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(),
                             TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(label, total=None)

    def __enter__(self) -> Callable[[int, int], None]:
        self._bar.start()
        return lambda done, steps: self._bar.update(self._task, completed=done, total=steps)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()


class ReadingLine:
    """A line on standard error while a log is read: samples and, where it is known, share and time that remains.

        with ReadingLine("reading") as line:
            stream_pitches(log, choice, told=line.told, read=line.read)

    It comes when reading goes on for longer, or when nothing comes; nothing where standard error is no terminal.
    """

    def __init__(self, label: str) -> None:
        console = Console(stderr=True)
        room = min(max(console.width - _BESIDE_THE_BAR, _NARROWEST_BAR), _WIDEST_BAR)
        self._line = Progress(TextColumn("{task.description}"), BarColumn(room), TaskProgressColumn(),
                              TextColumn("{task.fields[samples]:,} samples"), TimeRemainingColumn(compact=True),
                              console=console, transient=True, disable=not console.is_interactive)
        self._task = self._line.add_task(label, total=None, samples=0)
        self._samples = 0
        self._since: float | None = None  # when the first piece was read, and what is compiled was loaded
        self._waiting = threading.Timer(_WAITING, self._line.start)
        self._waiting.daemon = True

    def told(self, samples: int) -> None:
        """So many more are read."""
        self._samples += samples
        self._line.update(self._task, samples=self._samples)
        if self._since is None:
            self._since = time.monotonic()
        elif time.monotonic() - self._since > _SOON:
            self._line.start()

    def read(self, share: float) -> None:
        """So much of the log is read, 0 to 1."""
        self._line.update(self._task, completed=share, total=1.0)

    def __enter__(self) -> Self:
        self._waiting.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._waiting.cancel()
        self._waiting.join()  # it may be about to begin
        self._line.stop()


@contextlib.contextmanager
def printing() -> Iterator[None]:
    """While something is printed: whoever reads it may have gone (``| head``), or its disk may be full."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        # What is left goes nowhere: Python would write it once more, and complain, when the process ends.
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise typer.Exit(CLOSED_PIPE) from None
        fail(f"standard output cannot be written ({error.strerror or error})")


def print_json(document: dict[str, object]) -> None:
    """The document in one line."""
    print(json.dumps(document, allow_nan=False))


def fail(message: str) -> NoReturn:
    """Leave the command with this message."""
    raise lathe.LatheError(message)


def remark(message: str) -> None:
    """One line on standard error, without control characters that a file may have brought in."""
    print(f"threadpitch: {printable(' '.join(message.split()))}", file=sys.stderr)


def chosen_flavor(flavor: str | None) -> str:
    """The flavor of the FMUs that are built, with a note where it is Python's for want of a compiler."""
    chosen = lathe.choose_flavor(flavor)
    if flavor is None and chosen == "python":
        remark(f"note: the FMUs are built by PythonFMU and need Python where they run: {NO_COMPILER}")
    return chosen


def complain(message: str) -> int:
    """What is wrong, as a remark; the exit status that goes with it."""
    remark(message)
    return BAD_INPUT
