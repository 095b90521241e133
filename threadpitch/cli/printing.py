"""What commands print: results on standard output, progress and messages on standard error."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from typing import NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from threadpitch import lathe
from threadpitch.fmu import NO_COMPILER
from threadpitch.tables import printable

BAD_INPUT = 2
CLOSED_PIPE = 1


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


@contextlib.contextmanager
def counting(label: str) -> Iterator[Callable[[int], None]]:
    """A line on standard error that counts samples as they are told; nothing where that is no terminal."""
    console = Console(stderr=True)
    line = Progress(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.completed:,} samples"),
                    TimeElapsedColumn(), console=console, transient=True, disable=not console.is_terminal)
    task = line.add_task(label, total=None)
    with line:
        yield lambda samples: line.advance(task, samples)


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
