"""FMUs that others published on PyPI, with inputs and results: they give these results.

The package modestpy (BSD) holds a room with two thermal resistances and one capacity, compiled by JModelica.org in
2017, the temperatures around it and what its authors calculated from them. For Linux it wants the Fortran runtime of
GCC before 7, which distributions have given up, and calls it for nothing but messages of LAPACK: a library that has
these functions, and ends the process if one is called, stands in for it.
"""

from __future__ import annotations

import ctypes
import math
import platform
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from threadpitch.cosim import Method, simulate
from threadpitch.cosim.system import Component, Connection, System
from threadpitch.fmu import available_compiler, cached_fmu

PLATFORM = {("linux", "x86_64"): "linux64", ("win32", "AMD64"): "win64"}.get((sys.platform, platform.machine()))
PACKAGE = find_spec("modestpy")  # not imported: it brings more than its files
RESOURCES = [Path(place) / "test" / "resources" for place in PACKAGE.submodule_search_locations or ()
             ] if PACKAGE is not None else []
ROWS = 400  # of the table that plays the inputs
PARAMETERS = {"R1": 0.1, "R2": 0.25, "C": 2000.0}  # (parameters.csv)
START = 293.15  # K

RUNTIME = "libgfortran.so.3"
MESSAGES = {"GFORTRAN_1.0": ("concat_string", "st_write", "st_write_done"),
            "GFORTRAN_1.4": ("transfer_character_write", "transfer_integer_write")}

pytestmark = [
    pytest.mark.skipif(not RESOURCES, reason="modestpy is not installed; pip install 'threadpitch[test]'"),
    pytest.mark.skipif(PLATFORM is None, reason="modestpy's FMUs are for Linux and Windows on 64-bit Intel"),
    pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang"),
    pytest.mark.skipif(sys.platform == "linux" and shutil.which("gcc") is None, reason="no gcc to make a runtime with"),
]


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The Fortran runtime that the FMUs ask for: a library that is loaded under its name is the one that they get."""
    if sys.platform != "linux":
        return
    folder = tmp_path_factory.mktemp("runtime")
    names = [f"_gfortran_{name}" for found in MESSAGES.values() for name in found]
    (folder / "runtime.c").write_text("void abort(void);\n" + "".join(f"void {name}(void) {{ abort(); }}\n"
                                                                     for name in names))
    (folder / "versions").write_text("".join(f"{version} {{ {' '.join(f'_gfortran_{name};' for name in found)} }};\n"
                                             for version, found in MESSAGES.items()))
    subprocess.run(["gcc", "-shared", "-fPIC", "-w", f"-Wl,-soname,{RUNTIME}", "-Wl,--version-script=versions",
                    "runtime.c", "-o", RUNTIME], cwd=folder, check=True)
    ctypes.CDLL(str(folder / RUNTIME))


def table(path: Path) -> NDArray[np.float64]:
    return np.loadtxt(path, delimiter=",", skiprows=1, max_rows=ROWS)


def exact(inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """C T' = (Ti1 - T) / R1 + (Ti2 - T) / R2, the temperatures Ti between their rows on straight lines."""
    rate = (1.0 / PARAMETERS["R1"] + 1.0 / PARAMETERS["R2"]) / PARAMETERS["C"]
    drive = (inputs[:, 1] / PARAMETERS["R1"] + inputs[:, 2] / PARAMETERS["R2"]) / PARAMETERS["C"]
    temperatures = [START]
    for row, step in enumerate(np.diff(inputs[:, 0])):
        slope = (drive[row + 1] - drive[row]) / step
        begin, end = (drive[row] / rate - slope / rate**2, drive[row + 1] / rate - slope / rate**2)
        temperatures.append((temperatures[-1] - begin) * math.exp(-rate * step) + end)
    return np.array(temperatures)


@pytest.mark.usefixtures("runtime")
@pytest.mark.parametrize("engine", ["python", "kernel"])
@pytest.mark.parametrize("name", ["Simple2R1C", "Simple2R1C_ic"])
def test_the_room_of_modestpy_gives_its_published_temperatures(name: str, engine: str) -> None:
    folder = RESOURCES[0] / name.replace("Simple", "simple")
    inputs, published = table(folder / "inputs.csv"), table(folder / "result.csv")
    system = System("room", (
        Component("inputs", cached_fmu(Path(__file__).parent / "models" / "played_table.py", "native")),
        Component("room", folder / f"{name}_{PLATFORM}.fmu"),
    ), (Connection("inputs", "first", "room", "Ti1"), Connection("inputs", "second", "room", "Ti2")))
    given = {f"room.{parameter}": value for parameter, value in PARAMETERS.items()}
    given |= {"room.Tstart": START} if name.endswith("_ic") else {}
    result = simulate(system, step_size=60.0, stop_time=60.0 * (ROWS - 1), engine=engine,
                      method=Method(extrapolation={"room": 1}), parameters={
                          **given, "inputs.firsts": inputs[:, 1].tolist(), "inputs.seconds": inputs[:, 2].tolist()})
    assert result.time.tolist() == published[:, 0].tolist()
    far, off = np.abs(result["room.T"] - published[:, 1]).max(), np.abs(result["room.T"] - exact(inputs)).max()
    print(f"\n{name}, {engine}: {far:.4f} K from the published temperatures, {off:.1e} K from the exact ones")
    assert np.ptp(published[:, 1]) > 10.0
    assert far < 0.015  # their solver's tolerance: the published ones are as far from the exact ones
    assert off < 2e-3
