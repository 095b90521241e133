"""The FMUs in real importers: FMPy, libcosim and Ecos read the .ssp, wire and step it, and find the same pitches.

All three are Jacobi masters: every component sees the others as they were one step before, where threadpitch's master
(Gauss-Seidel in the order of the data) hands the angle on within the step. So they are compared twice: with our models
as plain objects in the importer's own order, equal to rounding; and with ``threadpitch.lathe.simulate``, within what
the delay can do. FMPy's ``simulate_ssp`` hands zeros to all inputs for the first step; the others begin consistently.
"""

from __future__ import annotations

import functools
import importlib.util
import itertools
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.plain_system import PlainSystem, read_plan
from threadpitch import lathe
from threadpitch.fmu import available_compiler, cached_fmu
from threadpitch.passes import Pass
from threadpitch.system_archive import FmuKind, build_system

RUN = Path(__file__).parent / "importer_run.py"
STEP_SIZE = 1e-3
STEPS = 2600  # to the 17th turn and a little more
CALCULATORS = ("nominal_pitch", "actual_pitch")
START_ANGLES = 4
SETTLED = 8  # turns; behind them the catch-up of the start, e^(-50 t), and the spindle's speed loop are over
LEAD = 1.5e-3
ENCODER_COUNTS = 4096
Columns = dict[str, list[float]]
Pitches = list[list[float]]  # (start_angles, revolutions) m


def added_times() -> Iterator[tuple[float, float]]:
    """(time, step size) of FMPy and Ecos: the time is added up."""
    time = 0.0
    while True:
        yield time, STEP_SIZE
        time += STEP_SIZE


def nanosecond_times() -> Iterator[tuple[float, float]]:
    """(time, step size) of libcosim: whole nanoseconds; a step is the difference of two times."""
    for step in itertools.count():
        time = step * 1_000_000 / 1e9
        yield time, (step + 1) * 1_000_000 / 1e9 - time


@dataclass(frozen=True)
class Importer:
    """What sets an importer apart: its package, its communication points, whether it begins consistently."""

    name: str
    package: str
    times: Callable[[], Iterator[tuple[float, float]]]
    settles: bool


IMPORTERS = (Importer("fmpy", "fmpy", added_times, settles=False),
             Importer("libcosim", "libcosimpy", nanosecond_times, settles=True),
             Importer("ecos", "ecospy", added_times, settles=True))
importers = pytest.mark.parametrize("importer", [
    pytest.param(one, id=one.name, marks=pytest.mark.skipif(
        importlib.util.find_spec(one.package) is None, reason=f"the importer {one.package} is not installed"))
    for one in IMPORTERS])

# The angle and the feed known exactly, and a spindle that turns evenly from the start
IDEAL = {
    "spindle.detector": 0, "controller.detector": 0, "spindle.ripple_amplitude[1]": 0.0,
    "spindle.initial_speed": 500.0 * math.pi / 30.0, "z_drive.encoder_counts": 0.0, "z_drive.lead_slope": 0.0,
    "z_drive.lead_amplitude": 0.0, "z_drive.backlash": 0.0, "cutting.bending_stiffness": 1e15,
}


@pytest.fixture(scope="module", params=["python", pytest.param("native", marks=pytest.mark.skipif(
    available_compiler() is None, reason="no C compiler and no ziglang is installed"))])
def kind(request: pytest.FixtureRequest) -> FmuKind:
    return FmuKind(request.param)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, kind: FmuKind) -> Path:
    return tmp_path_factory.mktemp(f"importers-{kind.flavor}")


@pytest.fixture(scope="module")
def shipped_ssp(folder: Path, kind: FmuKind) -> Path:
    return build_system(lathe.DEFAULT_SYSTEM, folder, kind)


@pytest.fixture(scope="module")
def ideal_ssp(folder: Path, kind: FmuKind) -> Path:
    """The lathe with one more parameter set, whose values win because it is the last."""
    system = folder / "ideal_lathe"
    shutil.copytree(lathe.find_system(lathe.DEFAULT_SYSTEM), system)
    parameters = "".join(
        f'<ssv:Parameter name="{name}"><ssv:{"Integer" if isinstance(value, int) else "Real"} value="{value}"/>'
        "</ssv:Parameter>" for name, value in IDEAL.items())
    (system / "resources" / "ideal.ssv").write_text(
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
        f'name="ideal"><ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>', encoding="utf-8")
    structure = system / "SystemStructure.ssd"
    text = structure.read_text(encoding="utf-8")
    end = "</ssd:ParameterBindings>"
    assert text.count(end) == 1
    structure.write_text(text.replace(end, f'<ssd:ParameterBinding source="resources/ideal.ssv"/>{end}'),
                         encoding="utf-8")
    return build_system(system, folder, kind)


def imported(importer: Importer, ssp: Path, folder: Path) -> Columns:
    """``component.variable`` after each step, as the importer shows it, in a process of its own; run once."""
    result = folder / f"{importer.name}-{ssp.stem}.json"
    if result.is_file():
        return json.loads(result.read_text(encoding="utf-8"))  # type: ignore[no-any-return]
    return run_alone(importer.name, ssp, result)


def run_alone(importer: str, system: Path, result: Path) -> Columns:
    """The importer's result of a system, in a process of its own."""
    libraries = [str(Path(sys.prefix) / "lib"), *filter(None, [os.environ.get("LD_LIBRARY_PATH")])]  # Ecos' libtbb
    done = subprocess.run([sys.executable, "-I", str(RUN), importer, str(system), str(STEPS), str(result)],
                          cwd=result.parent, env={**os.environ, "LD_LIBRARY_PATH": os.pathsep.join(libraries)},
                          check=False, capture_output=True, text=True, errors="replace", timeout=300)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return json.loads(result.read_text(encoding="utf-8"))  # type: ignore[no-any-return]


@functools.cache
def stepped_alike(importer: Importer) -> Columns:
    """The same of plain objects, in the importer's order and at its communication points, whatever FMUs it has."""
    system = PlainSystem(read_plan())
    if importer.settles:
        system.settle()
        system.transfer()
    columns: Columns = {f"{component}.{name}[{i + 1}]": [] for component in CALCULATORS for i in range(START_ANGLES)
                        for name in ("pitch", "revolution")}
    for time, step_size in itertools.islice(importer.times(), STEPS):
        system.jacobi_step(time, step_size)
        for name, values in columns.items():
            component, _, variable = name.partition(".")
            values.append(system.components[component].get(variable))
    return columns


def pitches(columns: Columns, component: str) -> Pitches:
    """P(n): the pitch at the step that ends turn n."""
    found: Pitches = []
    for i in range(1, START_ANGLES + 1):
        revolution = np.array([0, *columns[f"{component}.revolution[{i}]"]])
        ends = np.flatnonzero(np.diff(revolution))
        assert revolution[ends + 1].tolist() == list(range(1, ends.size + 1))
        found.append(np.array(columns[f"{component}.pitch[{i}]"])[ends].tolist())
    return found


def settled_differences(one: Pitches, other: Pass) -> NDArray[np.float64]:
    """(start_angles, turns) m, the turns after the start that both have."""
    turns = min(min(map(len, one)), other.table.pitch.shape[1])
    assert turns > SETTLED + 8
    return np.array([row[SETTLED:turns] for row in one]) - other.table.pitch[:, SETTLED:turns]


@importers
def test_an_importer_calculates_what_plain_objects_do_in_its_order(
        importer: Importer, shipped_ssp: Path, folder: Path) -> None:
    found, expected = imported(importer, shipped_ssp, folder), stepped_alike(importer)
    assert found.keys() == expected.keys()
    largest, equal, count = 0.0, 0, 0
    for name, values in expected.items():
        if ".revolution[" in name:
            assert found[name] == values, name
            assert max(values) > SETTLED + 8, name
        difference = np.abs(np.array(found[name]) - np.array(values))
        largest = max(largest, float(np.max(difference)))
        equal, count = equal + int(np.count_nonzero(difference == 0.0)), count + difference.size
    print(f"\n{importer.name} and plain objects in its order: {equal} of {count} values equal bit for bit, "
          f"largest difference {largest:.1e} m")
    assert largest <= 1e-12


@pytest.mark.skipif(importlib.util.find_spec("ecospy") is None, reason="the importer ecospy is not installed")
@pytest.mark.skipif(available_compiler() is None, reason="no C compiler and no ziglang is installed")
def test_ecos_calculates_the_same_with_fmus_of_fmi_3(tmp_path: Path) -> None:
    # two PitchCalculators are two instances of one FMU in one process; Ecos hands over scalars only
    plan = read_plan()
    plan = replace(plan, settings=tuple(one for one in plan.settings if "[" not in one.variable.name))
    fmus = {name: cached_fmu(lathe.model_file(plan.descriptions[name].path.stem), "native", fmi=3)
            for name in plan.order}
    assert fmus["nominal_pitch"] == fmus["actual_pitch"]
    scalars = [f"{name}.{one.name}" for name in plan.order for one in plan.descriptions[name].variables.values()
               if one.kind == "Real" and one.causality == "output" and "[" not in one.name]
    system = tmp_path / "system.json"
    system.write_text(json.dumps({
        "fmus": {name: str(path) for name, path in fmus.items()}, "wanted": scalars,
        "links": [(link.source.kind, f"{link.source_component}::{link.source.name}",
                   f"{link.target_component}::{link.target.name}") for link in plan.links],
        "parameters": {f"{one.component}::{one.variable.name}": one.value for one in plan.settings},
    }), encoding="utf-8")
    found = run_alone("ecos-fmi3", system, tmp_path / "result.json")
    plain = PlainSystem(plan)
    plain.settle()
    plain.transfer()
    expected: Columns = {name: [] for name in scalars}
    for time, step_size in itertools.islice(added_times(), STEPS):
        plain.jacobi_step(time, step_size)
        for name, values in expected.items():
            component, _, variable = name.partition(".")
            values.append(plain.components[component].get(variable))
    for name, values in expected.items():
        scale = max(map(abs, values))
        assert np.max(np.abs(np.array(found[name]) - np.array(values))) <= 1e-12 * scale, name
    travel = expected["z_drive.position"]
    assert max(travel) - min(travel) > 0.02
    equal = sum(found[name] == values for name, values in expected.items())
    print(f"\necos, FMI 3.0: {equal} of {len(scalars)} variables in {STEPS} steps equal bit for bit")


@pytest.fixture(scope="module")
def shipped_simulation(shipped_ssp: Path) -> lathe.Simulation:
    return lathe.simulate(shipped_ssp, stop_time=STEPS * STEP_SIZE, step_size=STEP_SIZE)


@importers
def test_quantised_detectors_let_settled_pitches_differ_by_counts(
        importer: Importer, shipped_ssp: Path, shipped_simulation: lathe.Simulation, folder: Path) -> None:
    # Q = lead / counts of the spindle's encoder. At a crossing the detected angle is up to Q of feed late, and the
    # command, which follows the detected angle, up to Q behind: P(n), a difference of two crossings, errs by at most
    # +-2 Q, two runs with different angles in their samples differ by at most 4 Q. The Z encoder adds 4 of its counts.
    # The feed is up to 3 steps later than with Gauss-Seidel (angle -> command -> drive, and the first step): a spindle
    # that is d_omega faster at the end of a turn than at its beginning changes P(n) by lead / 2 pi d_omega delay.
    speed = shipped_simulation["spindle.speed"][1000:].astype(np.float64)
    turn = round(60.0 / 500.0 / STEP_SIZE)
    change = float(np.max(np.abs(speed[turn:] - speed[:-turn])))
    bound = 4.0 * LEAD / ENCODER_COUNTS + 4.0 * 0.01 / 2**20 + LEAD / (2.0 * math.pi) * change * 3.0 * STEP_SIZE
    found = imported(importer, shipped_ssp, folder)
    for component in CALCULATORS:
        differences = settled_differences(pitches(found, component), shipped_simulation.passes_of(component)[0])
        # the sum of P(n) is a difference of two crossings as well
        largest, mean = float(np.max(np.abs(differences))), float(np.max(np.abs(np.mean(differences, axis=1))))
        print(f"\n{importer.name} - threadpitch, {component}: largest difference of a pitch {largest * 1e9:.0f} nm, of "
              f"the mean {mean * 1e9:.1f} nm in {differences.shape[1]} turns; bound {bound * 1e9:.0f} nm")
        assert largest <= bound
        assert mean <= bound / differences.shape[1]


@pytest.fixture(scope="module")
def ideal_simulation(ideal_ssp: Path) -> lathe.Simulation:
    return lathe.simulate(ideal_ssp, stop_time=STEPS * STEP_SIZE, step_size=STEP_SIZE)


@importers
def test_at_constant_speed_with_ideal_detectors_the_pitches_are_the_same(
        importer: Importer, ideal_ssp: Path, ideal_simulation: lathe.Simulation, folder: Path) -> None:
    # The feed is lead / 2 pi omega (t - delay): whatever the delay, P(n) = lead, and a crossing between two samples of
    # straight lines is exact. What the start has left after 8 turns is below e^(-18.6 * 0.96) of some micrometres
    # (18.6 1/s: the spindle's speed loop, which FMPy's first zero command disturbs).
    found = imported(importer, ideal_ssp, folder)
    for component in CALCULATORS:
        one = ideal_simulation.passes_of(component)[0]
        differences = settled_differences(pitches(found, component), one)
        error = np.max(np.abs(one.table.pitch[:, SETTLED:SETTLED + differences.shape[1]] - LEAD))
        largest = np.max(np.abs(differences))
        print(f"\n{importer.name} - threadpitch, {component}, ideal: largest difference {largest:.1e} m, "
              f"of threadpitch from the lead {error:.1e} m, in {differences.size} turns")
        assert largest < 1e-9
        assert error < 1e-9
