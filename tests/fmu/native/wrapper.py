"""The hand-written wrapper around a hand-written model, compiled for the tests, in FMPy."""

from __future__ import annotations

import atexit
import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave

HERE = Path(__file__).parent
C_SOURCES = HERE / "c"
WRAPPER = HERE.parents[2] / "threadpitch" / "fmu" / "c"
HEADERS = Path(fmpy.__file__).parent / "c-code"
WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")
OK, DISCARD, ERROR = 0, 2, 3  # fmi2Status and fmi3Status
GUID, TOKEN = "{guid-2}", "{token-3}"

# value references of FMI 2: the elements of arrays one by one
FORCE, LOAD_1, ENABLED, COMMAND, POSITION, HISTORY_1 = 0, 1, 3, 4, 5, 6
STEPS, COMPLETED_1, SEEN_1, VELOCITY, MASS, KIND, WEIGHT_1, WEIGHT_2 = 10, 11, 13, 15, 16, 17, 18, 19
GUIDED, LIMIT, FORCE_RATE, FORCE_CURVATURE = 20, 21, 22, 23
REALS = (0, 1, 2, 5, 6, 7, 8, 9, 15, 16, 18, 19, 22, 23)
INTEGERS = (4, 10, 11, 12, 17, 21)
BOOLEANS = (3, 13, 14, 20)

needs_compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc to compile the wrapper with")


@functools.cache
def folder() -> Path:
    """A folder of this process for what it compiles."""
    made = Path(tempfile.mkdtemp(prefix="wrapper"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def sources(version: int) -> list[Path]:
    """The wrapper's files for one version of FMI."""
    return sorted(path for path in WRAPPER.glob("*.c")
                  if not path.name.startswith("fmi") or path.name.startswith(f"fmi{version}"))


@functools.cache
def compiled(name: str, files: tuple[Path, ...], flags: tuple[str, ...]) -> Path:
    """The library or program that gcc makes of the files; a warning is an error."""
    target = folder() / name
    target.parent.mkdir(parents=True, exist_ok=True)
    command = ["gcc", *WARNINGS, *flags, "-ffp-contract=off", "-I", str(WRAPPER), "-I", str(C_SOURCES),
               "-isystem", str(HEADERS), *map(str, files), "-o", str(target), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return target


def library(version: int, *flags: str) -> Path:
    """The test model's FMU library, in an unzipped FMU's folder of its own."""
    place = "linux64" if version == 2 else fmpy.platform_tuple
    unzipped = f"fmi{version}{''.join(flags)}"
    name = f"{unzipped}/binaries/{place}/test_model{fmpy.sharedLibraryExtension}"
    return compiled(name, (*sources(version), C_SOURCES / "test_model.c"), ("-O2", "-fPIC", "-shared", *flags))


def program(name: str, version: int, *flags: str) -> Path:
    """A program of the tests' C folder with the wrapper and the test model in it."""
    files = (C_SOURCES / f"{name}.c", C_SOURCES / "test_model.c", *sources(version))
    return compiled("-".join((name, *flags)).replace("/", "_"), files, flags)


def run_program(path: Path, *arguments: str, data: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    """What the program says to these bytes on its standard input."""
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"}
    return subprocess.run([*arguments, str(path)], input=data, capture_output=True, check=False, env=environment)


Message = tuple[int, str, str]  # status, category, text


class Slave2:
    """An FMI 2 instance; ``call`` gives the status instead of raising."""

    def __init__(self, name: str = "one", guid: str = GUID, logging: bool = True) -> None:
        path = library(2)
        self.log: list[Message] = []
        self.fmu: Any = FMU2Slave(guid=guid, unzipDirectory=str(path.parents[2]), modelIdentifier="test_model",
                                  instanceName=name)
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._logged)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        self.fmu.instantiate(callbacks=callbacks, loggingOn=logging)

    def _logged(self, _environment: Any, _name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def initialize(self) -> None:
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def everything(self) -> list[str]:
        """Every variable, bit for bit."""
        return [float(value).hex() for value in self.fmu.getReal(REALS)] + [
            str(value) for value in (*self.fmu.getInteger(INTEGERS), *self.fmu.getBoolean(BOOLEANS))]

    def derive(self, references: Sequence[int], orders: Sequence[int], values: Sequence[float]) -> None:
        self.fmu.setRealInputDerivatives(references, orders, values)


@contextmanager
def slave2(name: str = "one", logging: bool = True) -> Iterator[Slave2]:
    made = Slave2(name, logging=logging)
    try:
        yield made
    finally:
        made.fmu.freeInstance()


def status(slave: Slave2 | Slave3, function: str, *arguments: Any) -> int:
    """What an FMI function returns."""
    return int(getattr(slave.fmu.dll, function)(slave.fmu.component, *arguments))


def reals(*values: float) -> Any:
    """An array of double."""
    return (ctypes.c_double * len(values))(*values)


def references(*values: int) -> Any:
    """An array of value references."""
    return (ctypes.c_uint * len(values))(*values)


class Slave3:
    """An FMI 3 instance."""

    def __init__(self, *, token: str = TOKEN, clocks: bool = True, update: Callable[..., None] | None = None,
                 required: Sequence[int] | None = None, event_mode: bool = False, logging: bool = True) -> None:
        path = library(3) if clocks else library(3, "-DCLOCK_COUNT=0")
        self.log: list[Message] = []
        self.fmu: Any = FMU3Slave(guid=token, unzipDirectory=str(path.parents[2]), modelIdentifier="test_model",
                                  instanceName="one")
        self.fmu.instantiate(loggingOn=logging, eventModeUsed=event_mode, logMessage=self._logged,
                             intermediateUpdate=update, requiredIntermediateVariables=required)

    def _logged(self, _environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append((status, category.decode(), message.decode()))

    def initialize(self) -> None:
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()


@contextmanager
def slave3(**arguments: Any) -> Iterator[Slave3]:
    made = Slave3(**arguments)
    try:
        yield made
    finally:
        made.fmu.freeInstance()
