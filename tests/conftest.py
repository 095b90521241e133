"""What all tests share: one cache of built FMUs, and the command line as a function."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import pytest

from tests.browser import chromium
from threadpitch import lathe
from threadpitch.cli import invoke

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# A shell starts background jobs with Ctrl-C ignored, and so would these tests and the processes that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


class Outcome(NamedTuple):
    """What a command leaves: its exit status, standard output and standard error."""

    status: int
    out: str
    err: str


Command: TypeAlias = Callable[..., Outcome]


@pytest.fixture(scope="session", autouse=True)
def fmu_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """FMUs are built once for all tests, and not into the cache of the user."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base  # of all workers of one run
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THREADPITCH_CACHE", str(shared / "fmu-cache"))
        yield


@pytest.fixture
def threadpitch(capsys: pytest.CaptureFixture[str]) -> Command:
    """``threadpitch("run", "--json")`` runs the command line in this process."""

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        status = invoke([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(status, captured.out, captured.err)

    return run


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def short_run(fmu_cache: None) -> lathe.Simulation:
    """The shipped lathe for 1.2 s: seven turns of the M20x1.5 thread from four start angles."""
    return lathe.simulate(stop_time=1.2)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A Chromium without a window; tests that need it skip where there is none."""
    with chromium() as opened:
        yield opened


def assert_one_line(text: str, message: str) -> None:
    """What is wrong in one line, which can be searched for ``message``."""
    assert text.startswith("threadpitch: ")
    assert text.count("\n") == 1
    assert text.endswith("\n")
    assert re.search(message, text), text
