"""FMUs and systems that nobody here wrote: they run, and give the outputs that were published with them.

They are looked for in the installed packages (those of modestpy, which need inputs, are in test_cosim_published.py)
and in the folder that ``THREADPITCH_FOREIGN`` names; the FMUs of modelica/Reference-FMUs, for instance, carry their
results (``extra/org.fmi-standard.fmi-ls-ref/<Name>_out.csv``).
"""

from __future__ import annotations

import contextlib
import csv
import io
import os
import sysconfig
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description

from threadpitch.cosim import StepError, read_system, simulate
from threadpitch.cosim.description import FmuDescription, read_fmu
from threadpitch.cosim.system import Component, System

FOLDERS = [Path(sysconfig.get_path("purelib")), *map(Path, filter(None, [os.environ.get("THREADPITCH_FOREIGN")]))]
FOUND = [path for folder in FOLDERS for path in sorted(folder.rglob("*.[fs][ms][up]"))
         if path.suffix in (".fmu", ".ssp") and not {"threadpitch", "modestpy"} & {*path.parts}]
WHY_NONE = "no installed package holds an FMU or SSP; name a folder of them in THREADPITCH_FOREIGN"


def named(path: Path) -> str:
    return "/".join(path.parts[-3:])


def of_kind(suffix: str) -> list[object]:
    paths = [path for path in FOUND if path.suffix == suffix]
    return [pytest.param(path, id=named(path)) for path in paths] or [
        pytest.param(None, marks=pytest.mark.skip(reason=WHY_NONE))]


def runnable(path: Path) -> bool:
    """Whether it is what this master says that it runs: FMI 2.0 or 3.0 co-simulation."""
    with contextlib.suppress(Exception):
        described = read_model_description(str(path))
        return described.coSimulation is not None and str(described.fmiVersion)[0] in "23"
    return False


def published(path: Path) -> list[dict[str, str]]:
    """The rows of the results that an FMU carries, or that lie beside it."""
    with zipfile.ZipFile(path) as packed:
        names = [name for name in packed.namelist() if name.endswith(("_out.csv", "_ref.csv"))]
        if names:
            return list(csv.DictReader(io.StringIO(packed.read(names[0]).decode())))
    beside = [path.with_name(f"{path.stem}{end}") for end in ("_out.csv", "_ref.csv")]
    text = next((one.read_text() for one in beside if one.is_file()), "")
    return list(csv.DictReader(io.StringIO(text)))


def columns(rows: list[dict[str, str]], fmu: FmuDescription) -> dict[str, list[float]]:
    """The numbers of the published columns, by our names of the variables; of an array by element."""
    truth = {"true": 1.0, "false": 0.0}
    found: dict[str, list[float]] = {}
    for name in rows[0]:
        elements = [fmu.variables[name]] if name in fmu.variables else list(fmu.arrays.get(name, ()))
        for number, variable in enumerate(elements):
            if variable.exchanged and variable.causality in ("output", "local"):
                texts = [row[name].split()[number] for row in rows]
                found[variable.name] = [truth.get(text, 0.0) if text in truth else float(text) for text in texts]
    return found


@pytest.mark.parametrize("path", of_kind(".fmu"))
@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_foreign_fmus_give_their_published_outputs(path: Path, engine: str) -> None:
    if not runnable(path):
        pytest.skip("is not FMI 2.0 or 3.0 for co-simulation")
    rows = published(path)
    with contextlib.closing(read_fmu(path)) as fmu:
        expected = columns(rows, fmu) if rows else {}
        step = fmu.step_size
        if rows and not expected:
            pytest.skip("the results that it carries are of another model: none of them is a variable of it")
    if rows:
        times = [float(row["time"]) for row in rows]
        step, stop = round(times[1] - times[0], 9), times[-1]
    elif step is None:
        pytest.skip("states neither results nor a step")
    else:
        stop = 100 * step
    try:
        result = simulate(System("foreign", (Component("f", path),)), stop_time=stop, step_size=step,
                          record=[f"f.{name}" for name in expected] or ("outputs",), engine=engine)
        assert result.time[-1] == pytest.approx(stop)
    except StepError as error:
        if "asks to end the run" not in str(error) or error.result is None:
            raise
        result = error.result
    for name, values in expected.items():
        found = result[f"f.{name}"].astype(float)
        np.testing.assert_allclose(found, values[:found.size], rtol=1e-5, atol=1e-7, err_msg=name)


@pytest.mark.parametrize("path", of_kind(".ssp"))
def test_foreign_systems_run(path: Path) -> None:
    with read_system(path) as system:
        result = simulate(system, step_size=system.step_size or 0.01, stop_time=system.stop_time or 1.0)
    assert result.steps > 0
