"""FMUs and systems that nobody here wrote: they run, and give the outputs that were published with them.

They are looked for in the installed packages (those of modestpy, which need inputs, are in test_cosim_published.py)
and in the folder that ``THREADPITCH_FOREIGN`` names; the FMUs of modelica/Reference-FMUs, for instance, carry their
results (``extra/org.fmi-standard.fmi-ls-ref/<Name>_out.csv``). Systems are compared with what ``published.json`` of
that folder says of them, and with libcosim.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import read_model_description

from tests.cosim.ssd_text import bound, box, ports, ssd, system, values, wire
from threadpitch.cosim import Method, Result, StepError, read_system, simulate, survey
from threadpitch.cosim.description import FmuDescription, read_fmu
from threadpitch.cosim.system import Component, System

FOLDERS = [Path(sysconfig.get_path("purelib")), *map(Path, filter(None, [os.environ.get("THREADPITCH_FOREIGN")]))]
FOUND = [path for folder in FOLDERS for path in sorted(folder.rglob("*.[fs][ms][up]"))
         if path.suffix in (".fmu", ".ssp") and not {"threadpitch", "modestpy"} & {*path.parts}]
STEPS = 100  # of a comparison with another master
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
    for name, rightful in expected.items():
        found = result[f"f.{name}"].astype(float)
        np.testing.assert_allclose(found, rightful[:found.size], rtol=1e-5, atol=1e-7, err_msg=name)


# Systems: what was published of them stands in ``published.json`` of the folder, by hand: the path of each system in it
# -> {"step_size", "stop_time", "coupling", "parameters", "values": {"component.variable": value at the end}}.

SYSTEMS = [*(path for path in FOUND if path.suffix == ".ssp"),
           *(path.parent for folder in FOLDERS for path in sorted(folder.rglob("SystemStructure.ssd"))
             if "threadpitch" not in path.parts)]


def told(path: Path) -> dict[str, Any]:
    """What ``published.json`` says of a system."""
    for folder in FOLDERS:
        file = folder / "published.json"
        if file.is_file() and path.is_relative_to(folder):
            of: dict[str, dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))
            return of.get(str(path.relative_to(folder)), {})
    return {}


def systems() -> list[object]:
    return [pytest.param(path, id=named(path)) for path in SYSTEMS] or [
        pytest.param(None, marks=pytest.mark.skip(reason=WHY_NONE))]


@contextlib.contextmanager
def sound(path: Path) -> Iterator[System]:
    """The system; skips where it cannot be run here: FMI 1.0, model exchange, binaries of other platforms."""
    found = survey(path)
    if found.problems:
        pytest.skip(found.problems[0])
    with read_system(path) as foreign:
        yield foreign


def run_as_told(foreign: System, of: dict[str, Any], **more: Any) -> Result:
    step = of.get("step_size") or foreign.step_size or 0.01
    return simulate(foreign, parameters=of.get("parameters"), step_size=step, stop_time=of.get("stop_time", 10 * step),
                    method=Method(of.get("coupling", "gauss-seidel")), **more)


@pytest.mark.parametrize("path", systems())
@pytest.mark.parametrize("engine", ["python", "kernel"])
def test_foreign_systems_give_what_was_published(path: Path, engine: str) -> None:
    published = told(path)
    with sound(path) as foreign:
        names = list(published.get("values", ()))
        result = run_as_told(foreign, published, engine=engine, record=names or ("outputs",))
    assert result.completed
    for name in names:
        assert result[name][-1] == pytest.approx(published["values"][name], rel=1e-12), name


def agrees_with_libcosim(path: Path, folder: Path, step: float, refused: Callable[[str], object]) -> list[str]:
    """Our Jacobi coupling and libcosim's, which is one, give the same outputs; the names of what was compared."""
    pytest.importorskip("libcosimpy")
    run = subprocess.run([sys.executable, str(Path(__file__).with_name("libcosim_run.py")), str(path),
                          str(round(step * 1e9)), str(STEPS), str(folder / "result.json")], capture_output=True,
                         text=True, timeout=120)
    if run.returncode:
        refused(f"libcosim does not run it: {(run.stderr.strip() or 'no word').splitlines()[-1]}")
    theirs: dict[str, float] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    with sound(path) as foreign:
        result = simulate(foreign, step_size=step, stop_time=STEPS * step, method=Method("jacobi"))
    shared = [name for name in theirs if name in result]
    for name in shared:
        assert result[name][-1] == pytest.approx(theirs[name], rel=1e-9, abs=1e-12), name
    return shared


@pytest.mark.parametrize("path", [path for path in SYSTEMS if path.suffix == ".ssp"] or [
    pytest.param(None, marks=pytest.mark.skip(reason=WHY_NONE))])
def test_foreign_systems_agree_with_libcosim(path: Path, tmp_path: Path) -> None:
    with sound(path) as foreign:
        step = told(path).get("step_size") or foreign.step_size or 0.01
    assert agrees_with_libcosim(path, tmp_path, step, pytest.skip)


def test_an_own_system_agrees_with_libcosim(make_fmu: Callable[..., Path], tmp_path: Path) -> None:
    """The comparison itself, on a system of two with a loop and values."""
    ends = ports("input u Real", "output x Real")
    components = (box("a", ends + bound(values("start_x Real 2"))) + box("b", ends + bound(values("k Real 3"))))
    text = ssd(system(components, wire("a.x", "b.u") + wire("b.x", "a.u"))).replace("Box.fmu", "Probe.fmu")
    with zipfile.ZipFile(tmp_path / "own.ssp", "w") as packed:
        packed.writestr("SystemStructure.ssd", text)
        packed.write(make_fmu(tmp_path / "Probe.fmu"), "Probe.fmu")
    assert {"a.x", "b.x"} <= {*agrees_with_libcosim(tmp_path / "own.ssp", tmp_path, 0.01, pytest.fail)}
