"""A host in C without any Python, on this machine and on Windows (under wine): the dataclass's bits."""

from __future__ import annotations

import atexit
import functools
import importlib.util
import os
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy import read_model_description

from tests.fmu.driving import Values, random_inputs, random_parameters, read, run_python
from tests.fmu.native.building import every_model, zig_folder
from threadpitch.fmu import Model, cached_fmu, scalars

HOST = Path(__file__).parent / "c" / "host.c"
STEPS = 60
_LETTERS = {"float": "R", "int": "I", "bool": "B"}


def _hexadecimal(value: float) -> str:
    return struct.pack(">d", value).hex()


def _job(model: Model, parameters: Values, inputs: list[Values]) -> str:
    """The lines that host.c reads."""
    by_name = {scalar.name: scalar for scalar in scalars(model)}
    lines = [f"{_LETTERS[scalar.variable.kind]} {scalar.reference}" for scalar in by_name.values()]

    def put(values: Values) -> None:
        for name, value in values.items():
            scalar = by_name[name]
            number = _hexadecimal(float(value)) if scalar.variable.kind == "float" else f"{int(value) % 2**64:x}"
            lines.append(f"{_LETTERS[scalar.variable.kind].lower()} {scalar.reference} {number}")

    put(parameters)
    lines.append("x")
    step_size = model.experiment.step_size if model.experiment else 0.01
    for number, values in enumerate(inputs):
        put(values)
        if number == len(inputs) // 2:
            lines.append("g")
        lines.append(f"s {_hexadecimal(number * step_size)} {_hexadecimal(step_size)}")
    return "\n".join(lines) + "\n"


def _shown(model: Model, row: dict[str, str]) -> list[str]:
    """A row of ``run_python`` as host.c prints it."""
    found = []
    for scalar in scalars(model):
        text = row[scalar.name]
        kind = scalar.variable.kind
        if kind == "float":
            found.append(f"{int(_hexadecimal(float.fromhex(text)), 16):x}")
        else:
            found.append(str(int(text == "True")) if kind == "bool" else text)
    return found


def _check(path: Path, library: Path, guid: str, command: list[str]) -> None:
    """Run the model in the host and in Python."""
    model = read(path)
    generator = random.Random(7)
    parameters = random_parameters(model, generator)
    inputs = random_inputs(model, STEPS, generator)
    expected = run_python(model, model.model_class(), parameters, inputs)
    refused = next((number for number in range(STEPS) if all(
        value == expected[number][name] for name, value in expected[number + 1].items() if name not in inputs[0]
    )), STEPS)
    inputs = inputs[:refused]  # the host stops at the first refusal
    assert inputs
    done = subprocess.run([*command, str(library), guid], input=_job(model, parameters, inputs), capture_output=True,
                          text=True, check=False, env=_environment(), cwd=library.parent)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()]
    assert rows == [_shown(model, row) for row in expected[:refused + 1]]


def _environment() -> dict[str, str]:
    prefix = str(Path(tempfile.gettempdir()) / "threadpitch-test-wine")
    return dict(os.environ) | {"WINEPREFIX": prefix, "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml=",
                               "ASAN_OPTIONS": "detect_leaks=1", "UBSAN_OPTIONS": "print_stacktrace=1"}


def _unpacked(fmu: Path, folder: Path, platform: str, suffix: str) -> tuple[Path, str]:
    description = read_model_description(str(fmu))
    name = f"binaries/{platform}/{description.coSimulation.modelIdentifier}{suffix}"
    with zipfile.ZipFile(fmu) as archive:
        archive.extract(name, folder)
    return folder / name, description.guid


@functools.cache
def _host(command: tuple[str, ...], suffix: str) -> Path:
    """host.c compiled by this command; zig finds its C runtime again when it runs in the same folder."""
    folder = zig_folder() / "host"
    folder.mkdir(parents=True, exist_ok=True)
    own = Path(tempfile.mkdtemp(prefix="threadpitch-host-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    made = own / f"host{suffix}"
    libraries = [] if suffix else ["-ldl"]
    subprocess.run([*command, "-O1", f"-I{Path(fmpy.__file__).parent / 'c-code'}", str(HOST), "-o", str(made),
                    *libraries], check=True, cwd=folder, capture_output=True,
                   env=dict(os.environ) | {"ZIG_GLOBAL_CACHE_DIR": str(zig_folder()),
                                           "ZIG_LOCAL_CACHE_DIR": str(zig_folder())})
    return made


@every_model
@pytest.mark.skipif(shutil.which("gcc") is None or sys.platform != "linux", reason="the host is built by gcc on Linux")
def test_a_host_in_c_gets_the_bits_of_python(path: Path, tmp_path: Path) -> None:
    library, guid = _unpacked(cached_fmu(path, "native"), tmp_path, fmpy.platform, fmpy.sharedLibraryExtension)
    _check(path, library, guid, [str(_host(("gcc",), ""))])


@every_model
@pytest.mark.skipif(shutil.which("gcc") is None or sys.platform != "linux", reason="the host is built by gcc on Linux")
def test_no_error_of_memory_or_arithmetic(path: Path, tmp_path: Path) -> None:
    """The whole FMU, translated equations included, under AddressSanitizer and UndefinedBehaviorSanitizer."""
    with zipfile.ZipFile(cached_fmu(path, "native")) as archive:
        archive.extractall(tmp_path)
    guid = read_model_description(str(tmp_path)).guid
    watched = ("gcc", "-g", "-O1", "-fsanitize=address,undefined,float-cast-overflow,float-divide-by-zero",
               "-fno-sanitize-recover=all")
    library = tmp_path / "watched.so"
    subprocess.run([*watched, "-shared", "-fPIC", *sorted(map(str, (tmp_path / "sources").glob("*.c"))), "-lm",
                    "-o", str(library)], check=True)
    _check(path, library, guid, [str(_host(watched, ""))])


@every_model
@pytest.mark.skipif(shutil.which("valgrind") is None or shutil.which("gcc") is None, reason="valgrind is not installed")
def test_valgrind_finds_nothing(path: Path, tmp_path: Path) -> None:
    library, guid = _unpacked(cached_fmu(path, "native"), tmp_path, fmpy.platform, fmpy.sharedLibraryExtension)
    _check(path, library, guid, ["valgrind", "-q", "--leak-check=full", "--show-leak-kinds=definite,indirect,possible",
                                 "--error-exitcode=99", str(_host(("gcc",), ""))])


@every_model
@pytest.mark.skipif(shutil.which("wine") is None, reason="wine is not installed: the Windows library cannot run here")
@pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed")
def test_the_windows_library_gets_the_bits_of_python(path: Path, tmp_path: Path,
                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(zig_folder()))
    library, guid = _unpacked(cached_fmu(path, "native", platforms=["win64"]), tmp_path, "win64", ".dll")
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu")
    _check(path, library, guid, ["wine", str(_host(zig, ".exe"))])
